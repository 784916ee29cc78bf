// The lane of edits that have a place in time: moods, gains, locks.

import { made } from "../dom.js";
import { TEXT, filled } from "../strings.js";
import { placed } from "../sentences.js";

const LANE_PX = 18;

export class Lane {
  constructor(timeline) {
    this.timeline = timeline;
    this.selectable = true;
    this.element = made("div", { className: "track lane" });
  }

  draw() {
    const { timeline, timeline: { store, store: { line } } } = this, { moods, gains, drawn, holds, locks } = placed(line?.steps ?? []);
    const kinds = [moods, gains, drawn, holds, locks].filter((each) => each.length), lane = (each) => `${kinds.indexOf(each) * LANE_PX + 2}px`;
    const item = (top, className, text, start_s, end_s) => {
      const button = made("button", { type: "button", className, textContent: text, title: text, tabIndex: -1, onclick: () => {
        store.set({ span: end_s > start_s ? { start_s, end_s } : store.span, tab: "edit" });
        timeline.studio.player.seek(start_s);
      } });
      button.style.top = top;
      button.style.left = `${timeline.x(start_s)}px`;
      button.style.width = `${Math.max((end_s - start_s) * timeline.px_s, 12)}px`;
      return button;
    };
    const ends = (n) => moods[n + 1]?.time_s ?? timeline.duration_s;
    this.element.replaceChildren(
      ...moods.map(({ mood, time_s }, n) => item(lane(moods), "mood", mood, time_s, ends(n))),
      ...gains.map(({ channel, factor, start_s, end_s }) => item(lane(gains), "gain", `${channel} ×${factor}`, start_s, end_s)),
      ...drawn.map(({ channel, start_s, end_s }) => item(lane(drawn), "gain", filled(TEXT.drawn, { channel }), start_s, end_s)),
      ...holds.map(({ start_s, end_s }) => item(lane(holds), "gain", TEXT.held, start_s, end_s)),
      ...locks.map(({ start_s, end_s }) => item(lane(locks), "lock", TEXT.locked, start_s, end_s)),
    );
    this.element.hidden = !kinds.length;
    this.element.style.height = `${kinds.length * LANE_PX + 2}px`;
  }
}
