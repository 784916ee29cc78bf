// The real video of the recording, beside the face.

import { iconButton, make } from "../dom.js";
import { TEXT } from "../strings.js";
import { Following } from "./following.js";

export class Recorded extends Following {
  /**
   * @param {HTMLElement} place
   * @param {import("../studio.js").Studio} studio
   */
  constructor(place, studio) {
    super(make("video", { className: "recorded", muted: true, playsInline: true, preload: "auto", hidden: true, "aria-label": TEXT.recorded }), studio.store);
    this.place = place;
    this.video.addEventListener("error", () => { if (!this.video.hidden) studio.stage.say(TEXT.noRecorded); });
    this.button = iconButton("camera", TEXT.besideFace, () => this.toggle(), { id: "recorded", "aria-pressed": "false" });
    place.append(this.video);
    this.store.on(["recording"], () => this.offer());
  }

  get address() { return this.store.recording?.media?.video ?? ""; }

  /** When in the video the sound of the recording begins. */
  get begins_s() { return this.store.recording?.media?.sound_begins_s ?? 0; }

  /** Offer the video of a recording that has one. */
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
}
