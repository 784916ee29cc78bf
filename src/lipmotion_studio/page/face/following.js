// A silent video that follows the sound of the recording, which is its clock, too.

/** Further off than the second it is set to the time of the sound; further than the first it goes faster or slower. */
const NEAR_S = 0.01, FAR_S = 0.25, HASTE = 5, MOST_HASTE = 0.5, MOST_LEAD_S = 1;

export class Following {
  /**
   * @param {HTMLVideoElement} video
   * @param {import("../store.js").Store} store
   */
  constructor(video, store) {
    this.video = video;
    this.store = store;
    this.lead_s = 0; // how long the video took to go to a time, the last time
    this.moved = false; // whether it was to follow since it went to a time
    store.on(["time_s", "playing", "speed"], () => this.follow());
  }

  /** When in the video the sound of the recording begins; negative: the video begins later. */
  get begins_s() { return 0; }

  /** Show the picture of the time; while the sound plays, play along. */
  follow() {
    const { video, store: { time_s, playing, speed } } = this, last_s = Number.isFinite(video.duration) ? video.duration : Infinity;
    if (video.hidden) return;
    const at_s = time_s + this.begins_s, wanted_s = Math.min(Math.max(at_s, 0), last_s), off_s = video.currentTime - wanted_s;
    const runs = playing && at_s >= 0 && at_s < last_s && last_s < Infinity;
    if (!runs && !video.paused) video.pause();
    if (runs && video.paused) video.play().catch(() => {});
    this.moved = true;
    if (video.seeking) return;
    if (Math.abs(off_s) > (runs ? FAR_S : NEAR_S)) this.goTo(wanted_s + (runs ? speed * this.lead_s : 0));
    if (runs) video.playbackRate = speed * (1 - (Math.abs(off_s) > NEAR_S ? Math.min(Math.max(off_s * HASTE, -MOST_HASTE), MOST_HASTE) : 0));
  }

  /** Go to a time; if the sound has moved until the video is there, it is followed. */
  goTo(time_s) {
    const asked_ms = performance.now();
    this.moved = false;
    this.video.currentTime = time_s;
    this.video.addEventListener("seeked", () => {
      this.lead_s = Math.min((performance.now() - asked_ms) / 1000, MOST_LEAD_S);
      if (this.moved) this.follow();
    }, { once: true });
  }
}
