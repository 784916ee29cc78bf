// The real video of the line, beside the face; the sound element is its clock, too.

import { iconButton, made } from "../dom.js";
import { TEXT } from "../strings.js";

/** Further off than the second it is set to the time of the sound; further than the first it goes faster or slower. */
const NEAR_S = 0.01, FAR_S = 0.25, HASTE = 5, MOST_HASTE = 0.5, MOST_LEAD_S = 1;

export class Recorded {
  /**
   * @param {HTMLElement} place
   * @param {import("../studio.js").Studio} studio
   */
  constructor(place, studio) {
    this.place = place;
    this.store = studio.store;
    this.lead_s = 0; // how long the video took to go to a time, the last time
    this.moved = false; // whether it was to follow since it went to a time
    this.video = made("video", { className: "recorded", muted: true, playsInline: true, preload: "auto", hidden: true, "aria-label": TEXT.recorded });
    this.video.addEventListener("error", () => { if (!this.video.hidden) studio.stage.say(TEXT.noRecorded); });
    this.button = iconButton("camera", TEXT.besideFace, () => this.toggle(), { id: "recorded", "aria-pressed": "false" });
    place.append(this.video);
    this.store.on(["line"], () => this.offer());
    this.store.on(["time_s", "playing", "speed"], () => this.follow());
  }

  get address() { return this.store.line?.media?.video ?? ""; }

  /** When in the video the sound of the line begins. */
  get begins_s() { return this.store.line?.media?.sound_begins_s ?? 0; }

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
    const { video, store: { time_s, playing, speed } } = this, wanted_s = time_s + this.begins_s, off_s = video.currentTime - wanted_s;
    if (video.hidden) return;
    const runs = playing && Number.isFinite(video.duration) && wanted_s < video.duration;
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
