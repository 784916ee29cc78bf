// Keys, and what each does: the page of help is made from this table.

import { say } from "./sentences.js";

const LISTEN = { group: "listen" };

/**
 * A key: `code` or `key` of the event, `ctrl`, `shift`, `alt` where they must be held; `shown` and `help` for the panel of help.
 * @type {{key: string[], ctrl?: boolean, shift?: boolean, alt?: boolean, group: string, shown: string[], help: string,
 *   act: (studio: import("./studio.js").Studio, event: KeyboardEvent) => void}[]}
 */
export const KEYS = [
  { key: [" "], ...LISTEN, shown: ["space"], help: "play", act: (studio) => studio.player.toggle() },
  { key: ["j"], ...LISTEN, shown: ["J"], help: "back", act: (studio) => studio.player.back() },
  { key: ["k"], ...LISTEN, shown: ["K"], help: "stop", act: (studio) => studio.player.stop() },
  { key: ["l"], ...LISTEN, shown: ["L"], help: "forward", act: (studio) => studio.player.forward() },
  { key: ["o"], ...LISTEN, shown: ["O"], help: "loop", act: ({ store }) => store.set({ looping: !store.looping }) },
  { key: ["h"], ...LISTEN, shown: ["H"], help: "half", act: ({ store }) => store.set({ speed: store.speed === 0.5 ? 1 : 0.5 }) },
  { key: ["ArrowLeft", "ArrowRight"], ...LISTEN, shown: ["←", "→"], help: "frame", act: (studio, { key }) => studio.step(key === "ArrowLeft" ? -1 : 1) },
  { key: ["PageUp", "PageDown"], ...LISTEN, shown: ["PgUp", "PgDn"], help: "tenFrames", act: (studio, { key }) => studio.step(key === "PageUp" ? -10 : 10) },
  { key: ["Home", "End"], ...LISTEN, shown: ["Home", "End"], help: "ends", act: ({ player }, { key }) => player.seek(key === "Home" ? 0 : player.duration_s) },
  { key: ["Tab"], group: "edit", shown: ["Tab", "⇧ Tab"], help: "nextPhone", act: (studio, event) => studio.tab(event) },
  { key: ["ArrowUp", "ArrowDown"], group: "edit", shown: ["↑", "↓"], help: "wordOf", act: (studio, { key }) => studio.changeTier(key === "ArrowUp") },
  { key: ["Enter"], group: "edit", shown: ["Enter"], help: "type", act: (studio) => studio.type() },
  { key: ["s"], group: "edit", shown: ["S"], help: "splitPhone", act: (studio) => studio.withPhone((index) => studio.split(index)) },
  { key: ["m"], group: "edit", shown: ["M"], help: "mergePhone", act: (studio) => studio.withPhone((index) => studio.merge(index)) },
  { key: ["Delete", "Backspace"], group: "edit", shown: ["Del"], help: "removePhone", act: (studio) => studio.remove() },
  { key: ["i"], group: "edit", shown: ["I"], help: "insertPhone", act: (studio) => studio.focusOn("insert-phone") },
  { key: ["ArrowLeft", "ArrowRight"], shift: true, group: "edit", shown: ["⇧ ←", "⇧ →"], help: "moveEnd", act: (studio, { key }) => studio.nudge("end", key === "ArrowLeft" ? -1 : 1) },
  { key: ["ArrowLeft", "ArrowRight"], ctrl: true, shift: true, group: "edit", shown: ["⌃⇧ ←", "⌃⇧ →"], help: "moveStart",
    act: (studio, { key }) => studio.nudge("start", key === "ArrowLeft" ? -1 : 1) },
  { key: ["v"], group: "edit", shown: ["V"], help: "pinValue", act: (studio) => studio.focusOn("curve-value") },
  { key: ["d"], group: "edit", shown: ["D"], help: "drawTool", act: ({ store }) => store.set({ tool: store.tool === "draw" ? "select" : "draw" }) },
  { key: ["g"], group: "edit", shown: ["G"], help: "lockSpan", act: (studio) => studio.over(say.lock) },
  { key: ["f"], group: "edit", shown: ["F"], help: "holdSpan", act: (studio) => studio.over(say.hold) },
  { key: ["[", "]"], group: "edit", shown: ["[", "]"], help: "markStart", act: (studio, { key }) => studio.markSpan(key === "[") },
  { key: ["z"], ctrl: true, group: "edit", shown: ["⌃ Z"], help: "undo", act: (studio) => studio.undo() },
  { key: ["z", "y"], ctrl: true, shift: true, group: "edit", shown: ["⌃⇧ Z", "⌃ Y"], help: "redo", act: (studio) => studio.redo() },
  { key: ["Escape"], group: "edit", shown: ["Esc"], help: "leave", act: (studio) => studio.leave() },
  { key: ["+", "=", "-"], group: "look", shown: ["+", "−"], help: "zoom", act: ({ timeline }, { key }) => timeline.zoom(key === "-" ? 1 / 1.5 : 1.5) },
  { key: ["0"], group: "look", shown: ["0"], help: "whole", act: ({ timeline }) => timeline.fit() },
  { key: ["z"], group: "look", shown: ["Z"], help: "selection", act: ({ timeline, store }) => store.span && timeline.show(store.span) },
  { key: ["e"], group: "look", shown: ["E", "⇧ E"], help: "doubt", act: (studio) => studio.jump(1) },
  { key: ["x"], group: "look", shown: ["X"], help: "besideFace", act: ({ stage }) => stage.recorded.toggle() },
  { key: ["w"], group: "look", shown: ["W"], help: "why", act: ({ store }) => store.set({ tab: "why" }) },
  { key: ["a", "r"], group: "queue", shown: ["A", "R"], help: "approve", act: (studio, { key }) => studio.mark(key === "a" ? "approved" : "redo") },
  { key: ["a", "r"], shift: true, group: "queue", shown: ["⇧ A", "⇧ R"], help: "approveNext", act: async (studio, { key }) => {
    await studio.mark(key === "a" ? "approved" : "redo");
    studio.queue.step(1);
  } },
  { key: ["n", "p"], group: "queue", shown: ["N", "P"], help: "nextRecording", act: ({ queue }, { key }) => queue.step(key === "n" ? 1 : -1) },
  { key: ["?"], group: "look", shown: ["?"], help: "help", act: (studio) => studio.help() },
];

const TYPED = "input:not([type=range]):not([type=checkbox]), textarea, select";

const PRESSED = "button, a, summary, [type=checkbox], [role=tab]";

/** Listen to keys, wherever the focus is but in fields that are typed into. */
export function listen(studio) {
  addEventListener("click", (event) => { // by a pointer, and not by a key: the keys are then those of the page again
    const pressed = /** @type {HTMLElement} */ (event.target).closest?.("button, summary");
    if (event.detail && pressed instanceof HTMLElement && !pressed.closest(".timeline, dialog")) pressed.blur();
  });
  addEventListener("keydown", (event) => {
    const target = /** @type {HTMLElement} */ (event.target);
    if (document.querySelector("dialog[open]") || event.altKey || event.isComposing) return;
    const ctrl = event.ctrlKey || event.metaKey, name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (target.matches?.(TYPED) && event.key !== "Escape") return;
    if (target.matches?.(PRESSED) && !target.closest(".timeline") && [" ", "Enter", "Tab"].includes(event.key)) return;
    if (target.matches?.("[type=range]") && (event.key.startsWith("Arrow") || ["Enter", "Tab"].includes(event.key))) return;
    if (name === "y" && ctrl && !event.shiftKey) return run(event, () => studio.redo());
    if (name === "e" && event.shiftKey && !ctrl) return run(event, () => studio.jump(-1));
    const symbol = event.key.length === 1 && !/[a-z ]/i.test(event.key);
    const found = KEYS.find((each) => each.key.includes(name) && Boolean(each.ctrl) === ctrl
      && (symbol || name === "Tab" || Boolean(each.shift) === event.shiftKey));
    if (!found) return;
    if (name === "Tab") return found.act(studio, event);
    return run(event, () => found.act(studio, { ...event, key: name }));
  });
}

function run(event, act) {
  event.preventDefault();
  act();
}
