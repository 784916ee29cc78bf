// The bar between face and timeline: play, loop, speed, time, undo, tools, zoom.

import { choice, icon, iconButton, make } from "./dom.js";
import { clock } from "./timeline/sound_tracks.js";
import { TEXT, fill } from "./strings.js";

const LIP_POINT = /^[xyz]_\d+$/, RAW = " raw";
/** Parts of the face in the order in which people look for them. */
const PARTS = ["jaw", "mouth", "tongue", "cheek", "nose", "brow", "eye"];

/** Return names of blendshapes by the part of the face, in order of names within it; others come last. */
function byPart(names) {
  const place = (name) => (PARTS.findIndex((part) => name.startsWith(part)) + PARTS.length + 1) % (PARTS.length + 1);
  return [...names].sort((a, b) => place(a) - place(b) || a.localeCompare(b));
}

export class Transport {
  /**
   * @param {HTMLElement} place
   * @param {import("./studio.js").Studio} studio
   */
  constructor(place, studio) {
    const { store, player, timeline } = studio;
    const pressed = (name, title, act, properties) => iconButton(name, title, act, { "aria-pressed": "false", ...properties });
    const play = iconButton("play", TEXT.play, () => player.toggle(), { id: "play" });
    const loop = pressed("loop", TEXT.loop, () => store.set({ looping: !store.looping }), { id: "loop" });
    const half = make("button", { type: "button", id: "half", textContent: "½×", title: TEXT.half, "aria-label": `½×, ${TEXT.half}`, "aria-pressed": "false",
      onclick: () => store.set({ speed: store.speed === 0.5 ? 1 : 0.5 }) });
    const time = make("output", { id: "time", "aria-label": TEXT.follow });
    const frame = make("span", { id: "frame" });
    const undo = iconButton("undo", TEXT.undo, () => studio.undo(), { id: "undo" }), redo = iconButton("redo", TEXT.redo, () => studio.redo(), { id: "redo" });
    const draw = pressed("draw", TEXT.draw, () => store.set({ tool: store.tool === "draw" ? "select" : "draw" }), { id: "draw" });
    const add = choice([], "", (name) => {
      if (name === RAW) return void store.set({ raw: !store.raw });
      const { channels } = store;
      studio.showCurves(channels.includes(name) ? channels.filter((each) => each !== name) : [...channels, name]);
    }, { id: "curves", "aria-label": TEXT.curvesShown });
    place.append(
      make("div", { className: "set" }, play, loop, half), time, frame, make("span", { className: "space" }),
      make("div", { className: "set" }, undo, redo), make("div", { className: "set" }, draw, add),
      make("div", { className: "set zoom" }, iconButton("minus", TEXT.zoomOut, () => timeline.zoom(1 / 1.5)), iconButton("plus", TEXT.zoomIn, () => timeline.zoom(1.5)),
        iconButton("fit", TEXT.fit, () => timeline.fit())));
    store.on(["playing"], () => {
      play.replaceChildren(icon(store.playing ? "pause" : "play"));
      play.title = store.playing ? TEXT.pause : TEXT.play;
      play.setAttribute("aria-label", play.title);
    });
    store.on(["looping", "speed", "tool"], () => {
      loop.setAttribute("aria-pressed", String(store.looping));
      half.setAttribute("aria-pressed", String(store.speed === 0.5));
      half.textContent = store.speed > 1 ? `${store.speed}×` : "½×";
      half.setAttribute("aria-label", `${half.textContent}, ${TEXT.half}`);
      draw.setAttribute("aria-pressed", String(store.tool === "draw"));
    });
    store.on(["tool"], () => { if (store.tool === "draw") studio.say(TEXT.drawing); });
    store.on(["recording"], () => {
      undo.disabled = !store.recording?.undo;
      redo.disabled = !store.recording?.redo;
    });
    store.on(["recording", "channels", "weights", "raw"], () => {
      const channels = (store.recording?.channels ?? []).map(({ name }) => name), shapes = (store.weights?.names ?? []).filter((name) => !name.includes("."));
      const group = (label, names) => names.length && make("optgroup", { label }, ...names.map((name) => make("option", { value: name,
        textContent: `${store.channels.includes(name) ? "✓ " : ""}${name}` })));
      add.replaceChildren(...[make("option", { value: "", textContent: TEXT.curves, disabled: true, selected: true }),
        group(TEXT.curveGroups.motion, channels.filter((name) => !LIP_POINT.test(name))), group(TEXT.curveGroups.shapes, byPart(shapes)),
        store.raw && group(TEXT.curveGroups.points, channels.filter((name) => LIP_POINT.test(name))),
        channels.some((name) => LIP_POINT.test(name)) && make("option", { value: RAW, textContent: store.raw ? TEXT.hideRaw : TEXT.showRaw })].filter(Boolean));
    });
    store.on(["time_s", "recording"], () => {
      time.textContent = `${clock(store.time_s)} / ${clock(player.duration_s)}`;
      frame.textContent = fill(TEXT.frame, { number: Math.round(store.time_s * (store.recording?.rate_hz ?? 100)) });
    });
  }
}
