// The weights of the face, portion by portion: first where the playhead is, so that the face follows an edit at once.

import { WhenCalm } from "../calm.js";
import { Curves } from "../curves.js";

/** Few portions at once: an edit waits until the server has made them. */
const PORTION_S = 0.5, AT_ONCE = 2, PLAYED_AHEAD = 20, AHEAD = 2, SHORT_S = 20;

export class Weights {
  /** @param {import("../studio.js").Studio} studio */
  constructor(studio) {
    this.studio = studio;
    this.store = studio.store;
    this.number = 0; // of what is asked for: replies to what was asked before are dropped
    this.held = null; // which portions are known
    this.running = false;
    this.exact = false; // whether all are those of the exported file
    this.settling = new WhenCalm(this.store, () => this.settle());
    this.store.on(["time_s"], () => this.look());
  }

  /** What is known is of another recording or face. */
  forget() {
    this.number += 1;
    this.held = null;
    this.exact = false;
    this.settling.drop();
  }

  /** Read again what has changed; null: all. */
  change(span) {
    this.number += 1;
    this.exact = false;
    this.settling.drop();
    if (!this.held || !span) this.held = null;
    else this.held.fill(0, this.portion(span.start_s), this.portion(span.end_s) + 1);
    return this.look();
  }

  portion(time_s) { return Math.max(Math.floor(time_s / PORTION_S), 0); }

  /** Whether the weights at a time are known. */
  known(time_s) { return Boolean(this.held?.[Math.min(this.portion(time_s), this.held.length - 1)]); }

  get isMesh() { return this.store.project?.forms.faces.find(({ name }) => name === this.store.face)?.mesh; }

  /** The next portions to ask for: the one at the playhead alone, then what follows; of a short recording all. */
  next() {
    const { recording, time_s, playing } = this.store, ahead = playing ? PLAYED_AHEAD : AHEAD, count = Math.max(Math.ceil(recording.duration_s / PORTION_S), 1);
    this.held ??= new Uint8Array(count);
    const here = Math.min(this.portion(time_s), count - 1), last = recording.duration_s <= SHORT_S ? count : Math.min(here + ahead, count);
    if (!this.held[here]) return [here, here + 1];
    let first = this.held.indexOf(0, here);
    if (first < 0 || first >= last) first = recording.duration_s <= SHORT_S ? this.held.indexOf(0) : -1;
    if (first < 0) return null;
    let stop = first + 1;
    while (stop < count && stop - first < AT_ONCE && !this.held[stop]) stop++;
    return [first, stop];
  }

  async look() {
    if (this.running || this.store.recording?.status !== "ready" || !this.isMesh) return;
    this.running = true;
    try {
      for (let next = this.next(); next; next = this.store.recording?.status === "ready" ? this.next() : null) await this.read(...next);
    } catch (error) {
      this.studio.refuse(error);
    }
    this.running = false;
    if (this.store.recording?.status === "ready" && !this.exact && this.store.recording.duration_s <= SHORT_S) this.settling.want();
  }

  address() { return `lines/${this.store.recordingId}/weights?face=${encodeURIComponent(this.store.face)}`; }

  async read(first, stop) {
    const { number, store, studio } = this, stretch = `&start_s=${first * PORTION_S}&end_s=${stop * PORTION_S}`;
    const { weights: part, mesh } = await studio.server.weights(this.address() + stretch);
    if (number !== this.number || !this.held) return;
    const frames = Math.max(store.recording.frames, part.first + part.frames), before = store.weights;
    const isSame = before && String(before.names) === String(part.names), fits = isSame && before.frames >= frames;
    const values = fits ? before.values : new Float32Array(frames * part.names.length).fill(NaN);
    if (isSame && !fits) values.set(before.values);
    if (!isSame) this.held.fill(0); // nothing is known of other weights
    values.set(part.values, part.first * part.names.length);
    this.held.fill(1, first, stop);
    if (this.known(store.time_s)) studio.faceComes();
    store.set({ weights: new Curves(part.names, part.rate_hz, values), mesh });
  }

  /** Take all weights as the file has them: a stretch differs a little, as its solution begins elsewhere. */
  async settle() {
    const { number, studio } = this;
    try {
      const { weights, mesh } = await studio.server.weights(this.address());
      if (number !== this.number) return;
      this.exact = true;
      this.store.set({ weights, mesh });
    } catch (error) {
      studio.refuse(error);
    }
  }
}
