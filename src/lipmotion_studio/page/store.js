// What the page knows. Whoever shows a part of it is notified when that part changes.

export class Store {
  #listeners = [];
  #changed = new Set();
  #waiting = false;

  constructor() {
    /** @type {any} */ this.project = null; // as the server says
    /** @type {any[]} */ this.recordings = [];
    /** @type {any} */ this.recording = null; // state of the open recording
    this.recordingId = "";
    /** @type {any} */ this.sound = null; // samples of the open recording
    /** @type {any} */ this.motion = null;
    /** @type {any} */ this.deviation = null;
    /** @type {any} */ this.confidence = null;
    /** @type {any} */ this.weights = null;
    /** @type {any} */ this.other = null; // curves and weights of the version it is compared with
    /** @type {any[]} */ this.doubts = [];
    /** @type {{kind: "phone" | "word" | "curve", index: number, channel?: string} | null} */ this.selected = null;
    /** @type {{start_s: number, end_s: number} | null} */ this.span = null;
    this.time_s = 0;
    this.comparing = false; // whether the other version is shown
    /** @type {"one" | "sides" | "over"} */ this.heads = "one"; // whether both are shown, and how
    /** @type {any} */ this.progress = null; // of the open recording
    /** @type {any} */ this.training = {}; // how far a voice or a face is
    this.tool = "select";
    this.channels = ["opening", "width", "outer"];
    this.raw = false; // whether the coordinates of single points are offered
    this.saving = 0;
    this.unsaved = false;
    this.tab = "edit";
    this.message = { text: "", kind: "" };
    this.playing = false;
    this.looping = false;
    this.speed = 1;
    this.face = "head";
    this.mesh = ""; // name of the character that the weights move; empty: that of the face
  }

  /** Change some of it; listeners run once, after the code that runs now. */
  set(changes) {
    for (const [name, value] of Object.entries(changes)) {
      if (this[name] === value) continue;
      this[name] = value;
      this.#changed.add(name);
    }
    if (this.#changed.size && !this.#waiting) {
      this.#waiting = true;
      queueMicrotask(() => this.#notify());
    }
  }

  /** The curves that have one of a name: the motion, or the weights of the face; null: neither. */
  curvesOf(name, { motion, weights } = this) { return [motion, weights].find((curves) => curves && curves.column(name) >= 0) ?? null; }

  /** Run `act` whenever one of some parts has changed, and now. */
  on(names, act) {
    this.#listeners.push([names, act]);
    act();
  }

  #notify() {
    const changed = this.#changed;
    this.#changed = new Set();
    this.#waiting = false;
    for (const [names, act] of this.#listeners) {
      if (!names.some((name) => changed.has(name))) continue;
      try {
        act();
      } catch (error) {
        reportError(error); // the others are notified all the same
      }
    }
  }
}
