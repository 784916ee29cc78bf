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
    const known = new Set(this.store.recording.channels.map(({ name }) => name));
    return this.store.channels.filter((name) => known.has(name));
  }

  /** Read some curves of a kind; `by`: as the server calls the model that moves the recording. */
  async read(id, of, names, span, by = "") {
    if (!names.length) return new Curves([], this.store.recording.rate_hz, new Float32Array());
    const stretch = span ? `&start_s=${span.start_s}&end_s=${span.end_s}` : "";
    return this.server.curves(`lines/${id}/motion?of=${of}&names=${names.map(encodeURIComponent).join()}&by=${by}${stretch}`);
  }

  /** Return curves with those that are shown and not among them, and without those that are not shown. */
  async completed(id, of, curves, by = "") {
    const { names } = this, missing = names.filter((name) => curves.column(name) < 0);
    return curves.and(await this.read(id, of, missing, null, by)).only(names);
  }

  /** Read again what has changed, of the recording with a number; null: all. */
  async change(id, span) {
    const { store, server, names } = this;
    const again = async (of) => {
      const part = await this.read(id, of, names, span), before = store[of];
      if (!span) return part;
      return before?.holds(part) ? before.patched(part) : this.read(id, of, names, null);
    };
    const [motion, deviation, confidence] = await Promise.all([
      again("motion"), again("deviation"), span ? store.confidence : server.curves(`lines/${id}/motion?of=confidence`)]);
    if (id !== store.recordingId) return;
    store.set({ motion, deviation, confidence });
    await this.fill(id);
  }

  /** Read what is shown by now and is not here, and forget what is not shown any more. */
  async fill(id) {
    const { store, store: { motion, deviation }, names } = this;
    if (!motion || String(motion.names) === String(names)) return; // what is still to come is filled then
    const [means, spreads] = await Promise.all([this.completed(id, "motion", motion), this.completed(id, "deviation", deviation)]);
    if (id !== store.recordingId) return;
    if (motion === store.motion) store.set({ motion: means, deviation: spreads });
    await this.fill(id);
  }
}
