// The timeline: what is heard, said and shown, over the same time.

import { inNextFrame, make, onDrag } from "../dom.js";
import { TEXT } from "../strings.js";
import { CurveTracks } from "./curve_tracks.js";
import { Lane } from "./lane.js";
import { ConfidenceStrip, Ruler, SpectrumTrack, WaveTrack } from "./sound_tracks.js";
import { Tier } from "./tier.js";

const MOST_PX_S = 4000, READABLE_PX_S = 100, LEAST_SPAN_PX = 4, FOLLOW_SHARE = 0.08;

export class Timeline {
  /**
   * @param {HTMLElement} place
   * @param {import("../studio.js").Studio} studio
   */
  constructor(place, studio) {
    this.studio = studio;
    this.store = studio.store;
    this.px_s = 100;
    this.width = 0; // until it is laid out
    this.left_px = 0;
    this.window = make("div", { className: "window" });
    this.extent = make("div", { className: "extent" }, this.window);
    this.scroller = make("div", { className: "scroller", tabIndex: 0, role: "group", "aria-label": TEXT.timeline }, this.extent);
    place.append(this.scroller);
    this.spanShade = make("div", { className: "span", hidden: true });
    this.playhead = make("div", { className: "playhead" });
    this.words = new Tier(this, "words");
    this.phones = new Tier(this, "phones");
    /** @type {any[]} */ this.tracks = [
      new Ruler(this), new Lane(this), new WaveTrack(this), new SpectrumTrack(this),
      this.words, this.phones, new ConfidenceStrip(this), new CurveTracks(this),
    ];
    this.window.append(...this.tracks.map(({ element }) => element), this.spanShade, this.playhead);
    for (const track of this.tracks) if (track.selectable) this.selecting(track.element);
    this.draw = inNextFrame(() => this.drawNow());
    this.scroller.addEventListener("scroll", () => {
      this.left_px = this.scroller.scrollLeft;
      this.draw();
    }, { passive: true });
    this.scroller.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.pinching();
    new ResizeObserver(() => this.resized()).observe(this.scroller);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      for (const track of this.tracks) track.recolour?.();
      this.draw();
    });
    this.store.on(["recordingId"], () => { this.fitted = false; });
    this.store.on(["sound", "recording"], () => {
      this.fitFirst();
      this.sized();
    });
    const { store } = this;
    store.on(["recording", "sound", "motion", "deviation", "confidence", "weights", "channels", "selected", "tool", "other", "comparing"], this.draw);
    store.on(["span"], () => this.place());
    store.on(["time_s"], () => this.followPlayhead());
  }

  get duration_s() { return this.studio.player.duration_s; }

  x(time_s) { return time_s * this.px_s - this.left_px; }

  time(x) { return Math.min(Math.max((x + this.left_px) / this.px_s, 0), this.duration_s); }

  /** The time under a pointer. */
  timeOf(event) { return this.time(event.clientX - this.window.getBoundingClientRect().left); }

  get start_s() { return this.left_px / this.px_s; }

  get end_s() { return Math.min((this.left_px + this.width) / this.px_s, this.duration_s); }

  get least_px_s() { return this.duration_s ? this.width / this.duration_s : 1; }

  resized() {
    const whole = this.px_s <= this.least_px_s * 1.001;
    this.width = this.scroller.clientWidth;
    this.window.style.width = `${this.width}px`;
    if (!this.width) return; // it is hidden
    if (!this.fitted) this.fitFirst();
    else if (whole || this.px_s < this.least_px_s) this.fit();
    else this.draw();
  }

  sized() {
    this.extent.style.width = `${Math.max(this.duration_s * this.px_s, this.width)}px`;
    this.draw();
  }

  /** Zoom so that a time stays where it is. */
  zoom(factor, time_s = this.store.time_s) {
    const x = Math.min(Math.max(this.x(time_s), 0), this.width), held = this.time(x);
    this.px_s = Math.min(Math.max(this.px_s * factor, this.least_px_s), MOST_PX_S);
    this.sized();
    this.scrollTo(held * this.px_s - x);
  }

  /** Show a recording that has just been opened: all of it, or as much as can be read. */
  fitFirst() {
    if (this.fitted || !this.duration_s || !this.width) return;
    this.fitted = true;
    this.fit();
    if (this.px_s < READABLE_PX_S) this.zoom(READABLE_PX_S / this.px_s, 0);
  }

  fit() {
    this.px_s = this.least_px_s;
    this.sized();
    this.scrollTo(0);
  }

  show(span) {
    const margin = (span.end_s - span.start_s) * 0.15 + 0.01;
    this.px_s = Math.min(Math.max(this.width / (span.end_s - span.start_s + 2 * margin), this.least_px_s), MOST_PX_S);
    this.sized();
    this.scrollTo((span.start_s - margin) * this.px_s);
  }

  /** Scroll so that a span is seen, if it is not. */
  reveal(start_s, end_s = start_s) {
    if (start_s >= this.start_s && end_s <= this.end_s) return;
    this.scrollTo((start_s + end_s) / 2 * this.px_s - this.width / 2);
  }

  scrollTo(left_px) {
    this.scroller.scrollLeft = left_px;
    this.left_px = this.scroller.scrollLeft;
    this.draw();
  }

  wheel(event) {
    if (event.ctrlKey || event.metaKey) {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY / 300), this.timeOf(event));
    } else if (Math.abs(event.deltaX) < Math.abs(event.deltaY) && !event.shiftKey && this.scroller.scrollHeight <= this.scroller.clientHeight + 1) {
      event.preventDefault();
      this.scrollTo(this.left_px + event.deltaY);
    }
  }

  /** Two fingers zoom. */
  pinching() {
    const apart = ({ touches: [a, b] }) => Math.abs(a.clientX - b.clientX) + 20;
    let before = 0;
    this.scroller.addEventListener("touchstart", (event) => { before = event.touches.length === 2 ? apart(event) : 0; }, { passive: true });
    this.scroller.addEventListener("touchmove", (event) => {
      if (!before || event.touches.length !== 2) return;
      event.preventDefault();
      const [a, b] = event.touches, now = apart(event);
      this.zoom(now / before, this.time((a.clientX + b.clientX) / 2 - this.window.getBoundingClientRect().left));
      before = now;
    }, { passive: false });
  }

  /** Clicks set the playhead, drags of a mouse select a span; a finger scrolls, and sets the playhead by a tap. */
  selecting(element) {
    element.classList.add("selectable");
    let from_s = 0, from_x = 0, before = null;
    onDrag(element, {
      start: (event) => {
        if (event.pointerType === "touch" || event.target.closest("button")) return false;
        if (this.store.tool === "draw" && element.classList.contains("curves")) return false;
        before = this.store.span;
        from_x = event.clientX;
        from_s = event.shiftKey && before ? (this.timeOf(event) > before.start_s ? before.start_s : before.end_s) : this.timeOf(event);
        this.scroller.focus({ preventScroll: true });
      },
      move: (event) => {
        if (Math.abs(event.clientX - from_x) < LEAST_SPAN_PX && !event.shiftKey) return;
        const now_s = this.timeOf(event);
        this.store.set({ span: { start_s: Math.min(from_s, now_s), end_s: Math.max(from_s, now_s) }, selected: null });
      },
      end: (event) => {
        if (Math.abs(event.clientX - from_x) >= LEAST_SPAN_PX || event.shiftKey) return;
        this.store.set({ span: null });
        this.studio.player.seek(this.timeOf(event));
      },
      cancel: () => this.store.set({ span: before }),
    });
    element.addEventListener("click", (event) => {
      if (event.pointerType === "touch" && !event.target.closest("button")) this.studio.player.seek(this.timeOf(event));
    });
  }

  followPlayhead() {
    const { time_s, playing } = this.store, x = this.x(time_s);
    if (playing && (x > this.width * (1 - FOLLOW_SHARE) || x < 0)) this.scrollTo(time_s * this.px_s - this.width * FOLLOW_SHARE);
    this.place();
  }

  place() {
    const { time_s, span } = this.store;
    this.playhead.style.transform = `translateX(${this.x(time_s)}px)`;
    this.spanShade.hidden = !span;
    if (!span) return;
    this.spanShade.style.transform = `translateX(${this.x(span.start_s)}px)`;
    this.spanShade.style.width = `${Math.max((span.end_s - span.start_s) * this.px_s, 1)}px`;
  }

  drawNow() {
    if (!this.width) return;
    for (const track of this.tracks) track.read?.();
    for (const track of this.tracks) track.draw();
    this.place();
  }
}
