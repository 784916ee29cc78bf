// The sound of the open recording, which is the clock of everything that moves.

const LOOP_LEAST_S = 0.03;

export class Player {
  /** @param {import("../store.js").Store} store */
  constructor(store) {
    this.store = store;
    this.audio = new Audio();
    this.audio.preservesPitch = true;
    this.backwards = null;
    this.audio.addEventListener("ended", () => {
      if (this.looped) return this.play();
      this.stop();
      return store.set({ time_s: this.duration_s });
    });
    this.follow = this.follow.bind(this);
    store.on(["speed"], () => { this.audio.playbackRate = store.speed; });
  }

  get duration_s() { return this.store.sound?.duration_s ?? this.store.recording?.duration_s ?? 0; }

  /** Take another sound, a WAV file. */
  load(buffer) {
    this.stop();
    if (this.audio.src) URL.revokeObjectURL(this.audio.src);
    this.audio.src = URL.createObjectURL(new Blob([buffer], { type: "audio/wav" }));
    this.audio.playbackRate = this.store.speed;
  }

  /** The span that is looped; null: all. */
  get looped() {
    const { span, looping } = this.store;
    return looping && span && span.end_s - span.start_s > LOOP_LEAST_S ? span : null;
  }

  seek(time_s) {
    const held = Math.min(Math.max(time_s, 0), this.duration_s);
    if (this.audio.src) this.audio.currentTime = held;
    this.store.set({ time_s: held });
  }

  async play() {
    if (!this.store.sound) return;
    const { looped } = this, { time_s } = this.store;
    if (looped && (time_s < looped.start_s || time_s >= looped.end_s - 0.005)) this.seek(looped.start_s);
    else if (time_s >= this.duration_s - 0.005) this.seek(0);
    else this.audio.currentTime = time_s;
    this.backwards = null;
    this.store.set({ playing: true });
    try {
      await this.audio.play();
    } catch (error) {
      if (error.name !== "AbortError") this.stop();
    }
    requestAnimationFrame(this.follow);
  }

  stop() {
    this.audio.pause();
    this.backwards = null;
    this.store.set({ playing: false, speed: Math.min(this.store.speed, 1) });
  }

  toggle() { return this.store.playing ? this.stop() : this.play(); }

  /** Play; again, while playing: twice as fast. */
  forward() {
    if (this.store.playing && !this.backwards) return this.store.set({ speed: Math.min(this.store.speed * 2, 4) });
    this.store.set({ speed: Math.max(this.store.speed, 1) });
    return this.play();
  }

  /** Go back at the speed of speech, without sound. */
  back() {
    this.audio.pause();
    this.backwards = { since_ms: performance.now(), from_s: this.store.time_s };
    this.store.set({ playing: true });
    requestAnimationFrame(this.follow);
  }

  /** Tell the time of the sound in every frame while it plays. */
  follow() {
    const { store, audio, backwards, looped } = this;
    if (!store.playing) return;
    if (backwards) {
      const time_s = backwards.from_s - (performance.now() - backwards.since_ms) / 1000;
      this.seek(time_s);
      if (time_s <= 0) return this.stop();
    } else {
      if (looped && audio.currentTime >= looped.end_s) audio.currentTime = looped.start_s;
      store.set({ time_s: audio.currentTime });
    }
    requestAnimationFrame(this.follow);
  }
}
