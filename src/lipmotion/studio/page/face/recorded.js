// The real video of the line, beside the face; the sound element is its clock, too.

import { iconButton, made } from "../dom.js";
import { TEXT } from "../strings.js";

/** Further off than the second it is set to the time of the sound; further than the first it goes faster or slower. */
const NEAR_S = 0.01, FAR_S = 0.15, HASTE = 2, MOST_HASTE = 0.2;

export class Recorded {
  /**
   * @param {HTMLElement} place
   * @param {import("../studio.js").Studio} studio
   */
  constructor(place, studio) {
    this.place = place;
    this.store = studio.store;
    this.video = made("video", { className: "recorded", muted: true, playsInline: true, preload: "auto", hidden: true, "aria-label": TEXT.recorded });
    this.video.addEventListener("error", () => { if (!this.video.hidden) studio.stage.say(TEXT.noRecorded); });
    this.button = iconButton("person", TEXT.besideFace, () => this.toggle(), { id: "recorded", "aria-pressed": "false" });
    place.append(this.video);
    this.store.on(["line"], () => this.offer());
    this.store.on(["time_s", "playing", "speed"], () => this.follow());
  }

  get address() { return this.store.line?.media?.video ?? ""; }

  /** Offer the video of a line that has one. */
  offer() {
    this.button.hidden = !this.address;
    if (!this.address) this.show(false);
    else if (!this.video.hidden) this.load();
  }

  toggle() { if (this.address) this.show(this.video.hidden); }

  show(isShown) {
    if (this.video.hidden === !isShown) return;
    this.video.hidden = !isShown;
    this.place.classList.toggle("with-recorded", isShown);
    this.button.setAttribute("aria-pressed", String(isShown));
    if (isShown) this.load();
    else this.video.pause();
  }

  load() {
    if (this.video.getAttribute("src") !== this.address) this.video.src = this.address;
    this.follow();
  }

  /** Show the picture of the time; while the sound plays, play along. */
  follow() {
    const { video, store: { time_s, playing, speed } } = this, off_s = video.currentTime - time_s;
    if (video.hidden) return;
    const runs = playing && Number.isFinite(video.duration) && time_s < video.duration;
    if (!runs && !video.paused) video.pause();
    if (runs && video.paused) video.play().catch(() => {});
    if (Math.abs(off_s) > (runs ? FAR_S : NEAR_S)) {
      if (!video.seeking) video.currentTime = time_s;
      else video.addEventListener("seeked", () => this.follow(), { once: true });
    }
    if (runs) video.playbackRate = speed * (1 - (Math.abs(off_s) > NEAR_S ? Math.min(Math.max(off_s * HASTE, -MOST_HASTE), MOST_HASTE) : 0));
  }
}
