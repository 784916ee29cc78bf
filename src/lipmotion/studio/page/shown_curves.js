// The curves of the motion that are shown, with their deviations: no others are asked for, and no others are kept.

import { Curves } from "./curves.js";

export class ShownCurves {
  /** @param {import("./studio.js").Studio} studio */
  constructor(studio) {
    this.store = studio.store;
    this.server = studio.server;
  }

  /** The curves of the motion among those that are shown; others are weights of the face. */
  get names() {
    const known = new Set(this.store.line.channels.map(({ name }) => name));
    return this.store.channels.filter((name) => known.has(name));
  }

  async read(id, of, names, span) {
    if (!names.length) return new Curves([], this.store.line.rate_hz, new Float32Array());
    const stretch = span ? `&start_s=${span.start_s}&end_s=${span.end_s}` : "";
    return this.server.curves(`lines/${id}/motion?of=${of}&names=${names.map(encodeURIComponent).join()}${stretch}`);
  }

  /** Read again what has changed, of the line with a number; null: all. */
  async change(id, span) {
    const { store, server, names } = this;
    const again = async (of) => {
      const part = await this.read(id, of, names, span), before = store[of];
      if (!span) return part;
      return before?.holds(part) ? before.patched(part) : this.read(id, of, names, null);
    };
    const [motion, deviation, confidence] = await Promise.all([
      again("motion"), again("deviation"), span ? store.confidence : server.curves(`lines/${id}/motion?of=confidence`)]);
    if (id !== store.lineId) return;
    store.set({ motion, deviation, confidence });
    await this.fill(id);
  }

  /** Read what is shown by now and is not here, and forget what is not shown any more. */
  async fill(id) {
    const { store, store: { motion, deviation }, names } = this;
    if (!motion || String(motion.names) === String(names)) return; // what is still to come is filled then
    const missing = names.filter((name) => motion.column(name) < 0);
    const [means, spreads] = await Promise.all(["motion", "deviation"].map((of) => this.read(id, of, missing, null)));
    if (id !== store.lineId) return;
    if (motion === store.motion) store.set({ motion: motion.and(means).only(names), deviation: deviation.and(spreads).only(names) });
    await this.fill(id);
  }
}
