// Curves of the motion with their deviations, pins, and the pen that draws over them.

import { make } from "../dom.js";
import { placed, say } from "../sentences.js";
import { cleared, colour } from "./canvas.js";

const SCALE_STEPS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10], SCALE_PX = 22;
const PAD_PX = 6, STROKE_STEP_S = 0.02, ROOM = 0.2, OF_WEIGHTS = [-0.06, 1.06];
const HANDLE_PX = 28, NEAR_PX = 8;

export class CurveTracks {
  constructor(timeline) {
    this.timeline = timeline;
    this.store = timeline.store;
    this.selectable = true;
    this.rows = new Map();
    this.stroke = null; // what is being drawn: channel and points by time
    this.grip = null; // the pin that is being moved, and where it is now
    this.element = make("div", { className: "track curves" });
  }

  draw() {
    const { channels, recording } = this.store;
    for (const [name, row] of this.rows) {
      if (channels.includes(name)) continue;
      row.element.remove();
      this.rows.delete(name);
    }
    this.element.classList.toggle("drawing", this.store.tool === "draw");
    if (channels.some((name) => !this.row(name).height)) this.read();
    const { pins, locks } = placed(recording?.steps ?? []);
    for (const name of channels) this.drawRow(name, this.row(name), pins.filter(({ channel }) => channel === name), locks);
  }

  row(name) {
    if (!this.rows.has(name)) {
      const canvas = make("canvas"), label = make("button", { type: "button", className: "label", textContent: name, tabIndex: -1 });
      const element = make("div", { className: "curve" }, canvas, label);
      element.dataset.channel = name;
      label.addEventListener("click", () => this.timeline.studio.chooseCurve(name));
      this.rows.set(name, { element, canvas, label, range: [0, 1], height: 0 });
      this.element.append(element);
      this.drawable(name, element);
    }
    return this.rows.get(name);
  }

  /** Read heights before anything is changed: the page is laid out once. */
  read() {
    const { selected } = this.store;
    for (const [name, row] of this.rows) row.element.classList.toggle("selected", selected?.kind === "curve" && selected.channel === name);
    for (const row of this.rows.values()) row.height = row.element.clientHeight;
  }

  /** The range of values that a row shows. */
  measure(row, curves, column) {
    if (row.of === curves) return;
    row.of = curves;
    const [least, most] = curves.range(column), room = (most - least) * ROOM || 0.05;
    row.range = curves === this.store.weights ? OF_WEIGHTS : [least - room, most + room];
  }

  y(row, value) {
    const [least, most] = row.range, { height } = row;
    return height - PAD_PX - ((value - least) / (most - least)) * (height - 2 * PAD_PX);
  }

  drawRow(name, row, pins, locks) {
    const { timeline, store, store: { deviation, selected, other, comparing } } = this, motion = store.curvesOf(name), its = other && store.curvesOf(name, other), { height } = row;
    const pen = cleared(row.canvas, timeline.width, height), isSelected = selected?.kind === "curve" && selected.channel === name;
    row.label.setAttribute("aria-pressed", isSelected);
    for (const { start_s, end_s } of locks) this.hatch(pen, timeline.x(start_s), timeline.x(end_s), height, colour.line);
    const column = motion?.column(name) ?? -1;
    if (column < 0) return;
    this.measure(row, motion, column);
    pen.fillStyle = colour.faint;
    pen.fillRect(0, Math.round(this.y(row, Math.max(row.range[0], 0))), timeline.width, 1);
    this.scale(pen, row);
    const frames = this.frames(motion), place = (frame) => timeline.x(frame / motion.rate_hz);
    const spread = deviation?.column(name) ?? -1;
    if (spread >= 0) this.band(pen, row, frames, place, (frame) => [motion.value(frame, column), deviation.value(frame, spread)], colour.band);
    if (its) this.trace(pen, row, frames, place, (frame) => its.value(frame, its.column(name)), colour.other, comparing ? 2 : 1);
    this.trace(pen, row, frames, place, (frame) => motion.value(frame, column), isSelected ? colour.main : colour.curve, comparing ? 1 : 1.5);
    pen.fillStyle = colour.main;
    for (const pin of pins) {
      const { time_s, value } = this.placeOf(pin), isChosen = isSelected && selected.pin_s === pin.time_s;
      this.dot(pen, timeline.x(time_s), this.y(row, value), isChosen ? 5 : 3);
      if (isChosen) this.handles(pen, row, pin);
    }
    if (this.stroke?.channel === name) {
      pen.strokeStyle = pen.fillStyle = colour.pen;
      pen.lineWidth = 2;
      pen.beginPath();
      for (const [time_s, value] of this.sorted()) pen.lineTo(timeline.x(time_s), this.y(row, value));
      pen.stroke();
    }
  }

  /** Frames to draw: about one a pixel at most. */
  frames(motion) {
    const { start_s, end_s, px_s } = this.timeline, step = Math.max(Math.floor(motion.rate_hz / px_s), 1), frames = [];
    const first = Math.floor((Math.max(start_s * motion.rate_hz - 1, 0)) / step) * step;
    for (let frame = first; frame <= Math.min(end_s * motion.rate_hz + step, motion.frames - 1); frame += step) frames.push(frame);
    return frames;
  }

  /** Lines at round values, which are written at the right. */
  scale(pen, row) {
    const { range: [least, most], height } = row, px = (height - 2 * PAD_PX) / (most - least);
    const step = SCALE_STEPS.find((each) => each * px >= SCALE_PX) ?? SCALE_STEPS.at(-1);
    pen.font = "10px system-ui, sans-serif";
    pen.textAlign = "right";
    for (let n = Math.ceil(least / step); n * step <= most; n++) {
      const y = Math.round(this.y(row, n * step));
      pen.fillStyle = colour.faint;
      pen.fillRect(0, y, this.timeline.width, 1);
      pen.fillStyle = colour.quiet;
      pen.fillText(String(Number((n * step).toFixed(2))), this.timeline.width - 4, y - 2);
    }
  }

  trace(pen, row, frames, place, value, colour, width) {
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.lineJoin = "round";
    pen.beginPath();
    for (const frame of frames) pen.lineTo(place(frame), this.y(row, value(frame)));
    pen.stroke();
  }

  band(pen, row, frames, place, values, colour) {
    pen.fillStyle = colour;
    pen.beginPath();
    for (const frame of frames) { const [mean, spread] = values(frame); pen.lineTo(place(frame), this.y(row, mean + spread)); }
    for (const frame of frames.reverse()) { const [mean, spread] = values(frame); pen.lineTo(place(frame), this.y(row, mean - spread)); }
    frames.reverse();
    pen.fill();
  }

  hatch(pen, from, to, height, colour) {
    pen.save();
    pen.beginPath();
    pen.rect(from, 0, to - from, height);
    pen.clip();
    pen.strokeStyle = colour;
    pen.globalAlpha = 0.5;
    pen.beginPath();
    for (let x = from - height; x < to; x += 7) {
      pen.moveTo(x, height);
      pen.lineTo(x + height, 0);
    }
    pen.stroke();
    pen.restore();
  }

  dot(pen, x, y, radius) {
    pen.beginPath();
    pen.arc(x, y, radius, 0, 2 * Math.PI);
    pen.fill();
  }

  /** Return a pin, where it is while it is being moved. */
  placeOf(pin) {
    const of = this.grip?.pin;
    return of?.channel === pin.channel && of.time_s === pin.time_s ? this.grip : pin;
  }

  /** The handles of a pin, which show the slope of the curve there: its ends [pixels]. */
  ends(row, pin) {
    const { slope, time_s, value } = this.placeOf(pin), { timeline, store } = this;
    const curve = store.curvesOf(pin.channel), step_s = 1 / curve.rate_hz, [before, after] = [-step_s, step_s].map((step) => curve.at(time_s + step, curve.column(pin.channel)));
    const rise = slope ?? (after - before) / (2 * step_s);
    const x = timeline.x(time_s), y = this.y(row, value), across = 1 / timeline.px_s, up = this.y(row, value + rise * across) - y;
    const length = HANDLE_PX / Math.hypot(1, up);
    return [-1, 1].map((side) => [x + side * length, y + side * up * length]);
  }

  handles(pen, row, pin) {
    const ends = this.ends(row, pin);
    pen.strokeStyle = colour.main;
    pen.lineWidth = 1;
    pen.beginPath();
    for (const end of ends) pen.lineTo(...end);
    pen.stroke();
    for (const end of ends) this.dot(pen, ...end, 2.5);
  }

  /** Return what of a pin is under the pointer: the pin, or a handle of the selected one. */
  gripAt(name, event) {
    const row = this.rows.get(name), box = row.element.getBoundingClientRect(), { selected, recording } = this.store;
    const near = ([x, y]) => Math.hypot(event.clientX - box.left - x, event.clientY - box.top - y) <= NEAR_PX;
    const pins = placed(recording.steps).pins.filter(({ channel }) => channel === name);
    const turned = pins.find((pin) => selected?.channel === name && pin.time_s === selected.pin_s && this.ends(row, pin).some(near));
    const pin = turned ?? pins.findLast(({ time_s, value }) => near([this.timeline.x(time_s), this.y(row, value)]));
    return pin && { ...pin, pin, turns: Boolean(turned), moved: false };
  }

  /** Move a pin, or turn its handles, to where the pointer is. */
  pull(time_s, value) {
    const { grip } = this, rate = this.store.recording.rate_hz;
    grip.moved = true;
    if (!grip.turns) return Object.assign(grip, { time_s: Math.max(Math.round(time_s * rate), 0) / rate, value });
    const off_s = time_s - grip.time_s;
    return Object.assign(grip, { slope: (value - grip.value) / (Math.sign(off_s) * Math.max(Math.abs(off_s), 1 / rate) || 1 / rate) });
  }

  async release() {
    const { pin, moved, time_s, value, slope } = this.grip, { channel } = pin, { studio } = this.timeline;
    studio.chooseCurve(channel, moved ? time_s : pin.time_s);
    if (moved) await studio.edit([say.unpin(channel, pin.time_s), say.pin(channel, value, time_s, slope)]);
    this.leave();
  }

  /** Draw over a curve with the pen: a click pins one value. Without it, pins and their handles can be moved. */
  drawable(name, element) {
    const value = (event) => {
      const row = this.rows.get(name), box = element.getBoundingClientRect(), [least, most] = row.range;
      const share = (box.bottom - PAD_PX - event.clientY) / (box.height - 2 * PAD_PX);
      return least + Math.min(Math.max(share, 0), 1) * (most - least);
    };
    const down = (event) => {
      if (event.button !== 0) return;
      const draws = this.store.tool === "draw", grip = !draws && this.store.curvesOf(name) && this.gripAt(name, event);
      this.timeline.studio.chooseCurve(name, grip ? grip.pin.time_s : null);
      if (!(draws && this.store.curvesOf(name)) && !grip) return;
      event.preventDefault();
      event.stopPropagation();
      element.setPointerCapture(event.pointerId);
      if (grip) this.grip = grip;
      else this.stroke = { channel: name, points: new Map() };
      const over = new AbortController();
      const add = (moved) => { this[grip ? "pull" : "point"](this.timeline.timeOf(moved), value(moved)); };
      if (draws) add(event);
      element.addEventListener("pointermove", (moved) => {
        for (const each of moved.getCoalescedEvents?.() ?? [moved]) add(each);
        this.timeline.draw();
      }, { signal: over.signal });
      element.addEventListener("pointerup", () => { over.abort(); grip ? this.release() : this.drop(); }, { signal: over.signal });
      element.addEventListener("pointercancel", () => { over.abort(); this.leave(); }, { signal: over.signal });
      addEventListener("keydown", (pressed) => {
        if (pressed.key !== "Escape") return;
        pressed.stopPropagation();
        over.abort();
        this.leave();
      }, { signal: over.signal, capture: true });
    };
    element.addEventListener("pointerdown", down);
  }

  point(time_s, value) {
    const rate = this.store.recording.rate_hz;
    this.stroke.points.set(Math.round(time_s * rate) / rate, value);
  }

  sorted() { return [...this.stroke.points].sort(([a], [b]) => a - b); }

  async drop() {
    const points = this.sorted(), { channel } = this.stroke;
    const [start_s, value] = points[0], end_s = points.at(-1)[0], count = Math.round((end_s - start_s) / STROKE_STEP_S) + 1;
    await this.timeline.studio.edit([count < 2 ? say.pin(channel, value, start_s) : say.draw(channel, alongLine(points, count), start_s, end_s)]);
    this.leave();
  }

  leave() {
    this.stroke = this.grip = null;
    this.timeline.draw();
  }
}

/** Return values at `count` equal distances on the lines between drawn points. */
export function alongLine(points, count) {
  const [start] = points[0], [end] = points.at(-1), along = [];
  for (let step = 0, n = 0; step < count; step++) {
    const time = start + ((end - start) * step) / (count - 1);
    while (n + 2 < points.length && points[n + 1][0] <= time) n++;
    const [before, from] = points[n], [after, to] = points[n + 1];
    along.push(from + Math.min((time - before) / (after - before), 1) * (to - from));
  }
  return along;
}
