// The lane of edits that have a place in time: moods, gains, drawn curves, held poses, locks.

import { make } from "../dom.js";
import { TEXT, fill } from "../strings.js";
import { placed } from "../sentences.js";

const ROW_PX = 18, LEAST_PX = 14;

export class Lane {
  constructor(timeline) {
    this.timeline = timeline;
    this.selectable = true;
    this.element = make("div", { className: "track lane" });
  }

  draw() {
    const { recording } = this.timeline.store;
    if (this.of !== recording) this.items = packed(itemsOf((this.of = recording)?.steps ?? [], this.timeline.duration_s));
    const { start_s, end_s } = this.timeline, rows = 1 + Math.max(-1, ...this.items.map(({ row }) => row));
    this.element.replaceChildren(...this.items.filter((item) => item.end_s >= start_s && item.start_s <= end_s).map((item) => this.button(item)));
    this.element.hidden = !rows;
    this.element.style.height = `${rows * ROW_PX + 2}px`;
  }

  button({ kind, text, start_s, end_s, row }) {
    const { timeline, timeline: { store, studio } } = this;
    const button = make("button", { type: "button", className: kind, textContent: text, title: text, tabIndex: -1, onclick: () => {
      store.set({ span: { start_s, end_s }, tab: "edit" });
      studio.player.seek(start_s);
    } });
    button.style.top = `${row * ROW_PX + 2}px`;
    button.style.left = `${timeline.x(start_s)}px`;
    button.style.width = `${Math.max((end_s - start_s) * timeline.px_s, LEAST_PX)}px`;
    return button;
  }
}

/** Return what edits have a place in time: kind, text, and where. */
function itemsOf(steps, duration_s) {
  const { moods, gains, drawn, holds, locks } = placed(steps);
  return [
    ...moods.map(({ mood, time_s }, n) => ({ kind: "mood", text: mood, start_s: time_s, end_s: moods[n + 1]?.time_s ?? duration_s })),
    ...gains.map((gain) => ({ ...gain, kind: "gain", text: `${gain.channel} ×${gain.factor}` })),
    ...drawn.map((stroke) => ({ ...stroke, kind: "gain", text: fill(TEXT.drawn, stroke) })),
    ...holds.map((hold) => ({ ...hold, kind: "gain", text: TEXT.held })),
    ...locks.map((lock) => ({ ...lock, kind: "lock", text: TEXT.locked })),
  ];
}

/** Return items with the row of each, so that none lies over another. */
function packed(items) {
  const ends = [];
  return items.sort((a, b) => a.start_s - b.start_s).map((item) => {
    const free = ends.findIndex((end_s) => end_s <= item.start_s), row = free < 0 ? ends.length : free;
    ends[row] = item.end_s;
    return { ...item, row };
  });
}
