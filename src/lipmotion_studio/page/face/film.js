// A video of a stretch of the recording in the place of the face; a filmed face is shown as such a video alone.

import { iconButton, make } from "../dom.js";
import { TEXT } from "../strings.js";
import { Following } from "./following.js";

/** How long a video that is made by itself waits for what else is asked of the recording. */
const SOON_MS = 500;

export class Film extends Following {
  /**
   * @param {HTMLElement} place
   * @param {import("./stage.js").Stage} stage
   */
  constructor(place, stage) {
    super(make("video", { className: "film", muted: true, playsInline: true, preload: "auto", hidden: true, "aria-label": TEXT.film }), stage.store);
    this.stage = stage;
    this.number = 0; // of the video that was asked for last: others that come are dropped
    /** @type {{recordingId: string, face: string, digest: string, start_s: number, end_s: number} | null} */ this.shown = null; // what it is a video of
    this.tried = ""; // recording and filmed face of which one was made by itself
    this.hasNote = false; // whether the note is of this
    this.button = iconButton("film", TEXT.film, () => this.toggle(), { id: "film", "aria-pressed": "false" });
    this.video.addEventListener("loadedmetadata", () => this.follow());
    place.append(this.video);
    this.store.on(["project", "face", "recordingId", "recording", "motion", "span"], () => this.check());
  }

  get begins_s() { return -(this.shown?.start_s ?? 0); }

  get isFilmed() { return Boolean(this.stage.form?.filmed); }

  /** What a video is made of now: the selection, or the recording, as far as videos go. */
  get wanted() {
    const { recordingId, face, recording, span, project } = this.store, longest_s = project?.forms.longest_video_s ?? Infinity, { start_s, end_s } = span ?? { start_s: 0, end_s: this.stage.studio.player.duration_s };
    return { recordingId, face, digest: recording?.edits_digest ?? "", start_s, end_s: Math.min(end_s, start_s + longest_s) };
  }

  /** Whether the video shows the stretch as it is now, and perhaps more. */
  get isNew() {
    const { shown, wanted } = this;
    return shown.digest === wanted.digest && shown.start_s <= wanted.start_s && shown.end_s >= wanted.end_s;
  }

  say(text) {
    if (text || this.hasNote) this.stage.say(text);
    this.hasNote = Boolean(text);
  }

  /** Leave a video that shows something else by now; of a filmed face, make one where there is none, and tell of an old one. */
  check() {
    const { recordingId, face, recording, motion } = this.store, { shown, isFilmed } = this;
    if (shown && (shown.recordingId !== recordingId || shown.face !== face || !recording)) this.leave();
    else if (shown && !isFilmed && !this.isNew) this.leave();
    else if (shown) this.say(this.isNew ? "" : TEXT.filmOld);
    if (!isFilmed) {
      if (this.tried) this.leave();
    } else if (recording?.status === "ready" && motion && !this.shown && this.tried !== `${recordingId} ${face}`) {
      this.tried = `${recordingId} ${face}`;
      this.say(TEXT.filmMaking);
      clearTimeout(this.soon);
      this.soon = setTimeout(() => this.make(), SOON_MS);
    }
  }

  toggle() { return this.shown && !this.isFilmed ? this.leave() : this.make(); }

  async make() {
    clearTimeout(this.soon);
    if (this.store.recording?.status !== "ready") return;
    const { wanted, stage: { studio } } = this, { recordingId, start_s, end_s, face } = wanted, number = this.number += 1;
    this.say(TEXT.filmMaking);
    try {
      const film = await (await studio.server.send(`lines/${recordingId}/video`, { start_s, end_s, face })).blob();
      const { recordingId: recordingNow, face: faceNow } = this.store;
      if (number !== this.number) return;
      if (recordingNow === recordingId && faceNow === face) this.show(wanted, film);
      else this.say("");
    } catch (error) {
      if (number === this.number) this.say(error.message);
    }
  }

  show(shown, film) {
    URL.revokeObjectURL(this.video.src);
    this.video.src = URL.createObjectURL(film);
    this.shown = shown;
    this.turn();
    this.say("");
    this.check();
  }

  leave() {
    clearTimeout(this.soon);
    this.number += 1;
    this.shown = null;
    this.tried = "";
    this.video.pause();
    URL.revokeObjectURL(this.video.src);
    this.video.removeAttribute("src");
    this.turn();
    this.say("");
  }

  /** The button says what it does: a filmed face has no other face to go back to. */
  turn() {
    const back = Boolean(this.shown) && !this.isFilmed;
    this.video.hidden = !this.shown;
    this.button.title = back ? TEXT.backToFace : TEXT.film;
    this.button.setAttribute("aria-label", this.button.title);
    this.button.setAttribute("aria-pressed", String(back));
  }
}
