// Tracks that follow from the sound, and the ruler above them.

import { make, onDrag } from "../dom.js";
import { TEXT } from "../strings.js";
import { ROWS, Spectra } from "../sound/spectrum.js";
import { cleared, colour } from "./canvas.js";

const STEPS_S = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120];
const LABEL_PX = 64, STRIP_PX = 2, STRIP_HEIGHT_PX = 15, SHADES = 8, TILE_PX = 256, TILES = 48;

export class Ruler {
  constructor(timeline) {
    this.timeline = timeline;
    this.canvas = make("canvas");
    this.element = make("div", { className: "track ruler" }, this.canvas);
    const seek = (event) => timeline.studio.player.seek(timeline.timeOf(event));
    onDrag(this.element, { start: seek, move: seek, end: seek });
  }

  draw() {
    const { timeline } = this, { width, px_s, start_s, end_s } = timeline;
    const pen = cleared(this.canvas, width, 20);
    const step = STEPS_S.find((each) => each * px_s >= LABEL_PX) ?? 300, digits = step < 0.1 ? 2 : step < 1 ? 1 : 0;
    pen.font = "11px system-ui, sans-serif";
    for (let n = Math.floor(start_s / step) * 5; (n * step) / 5 <= end_s; n++) {
      const time_s = (n * step) / 5, x = Math.round(timeline.x(time_s)) + 0.5;
      pen.fillStyle = colour.faint;
      pen.fillRect(x, n % 5 ? 15 : 10, 1, 10);
      if (n % 5) continue;
      pen.fillStyle = colour.quiet;
      pen.fillText(clock(time_s, digits), x + 4, 13);
    }
  }
}

/** Return a time as minutes and seconds. */
export function clock(time_s, digits = 3) {
  const whole = Number(time_s.toFixed(digits)), minutes = Math.floor(whole / 60);
  return `${minutes}:${(whole - 60 * minutes).toFixed(digits).padStart(digits ? 3 + digits : 2, "0")}`;
}

export class WaveTrack {
  constructor(timeline) {
    this.timeline = timeline;
    this.selectable = true;
    this.canvas = make("canvas", { role: "img", "aria-label": TEXT.sound });
    this.element = make("div", { className: "track wave" }, this.canvas);
  }

  read() { this.height = this.element.clientHeight; }

  draw() {
    const { height, timeline, timeline: { width, store: { sound } } } = this;
    const pen = cleared(this.canvas, width, height), middle = height / 2;
    pen.fillStyle = colour.faint;
    pen.fillRect(0, middle, width, 1);
    if (!sound) return;
    pen.fillStyle = colour.wave;
    for (let x = 0; x < width; x++) {
      const start_s = (timeline.left_px + x) / timeline.px_s;
      if (start_s >= sound.duration_s) break;
      const [least, most] = sound.extremes(start_s, start_s + 1 / timeline.px_s);
      const top = middle - most * (middle - 2), bottom = middle - least * (middle - 2);
      pen.fillRect(x, top, 1, Math.max(bottom - top, 1));
    }
  }
}

/** A spectrogram, drawn in tiles that are kept while the zoom stays as it is. */
export class SpectrumTrack {
  constructor(timeline) {
    this.timeline = timeline;
    this.selectable = true;
    this.tiles = new Map();
    this.canvas = make("canvas", { role: "img", "aria-label": TEXT.spectrum });
    this.element = make("div", { className: "track spectrum" }, this.canvas);
  }

  read() { this.height = this.element.clientHeight; }

  recolour() { this.tiles.clear(); }

  draw() {
    const { height, timeline, timeline: { width, px_s, left_px, store: { sound } } } = this;
    const pen = cleared(this.canvas, width, height);
    if (!sound) return;
    if (this.of !== sound) {
      this.spectra = new Spectra(this.of = sound);
      this.tiles.clear();
    }
    if (this.px_s !== px_s) {
      this.px_s = px_s;
      this.tiles.clear();
    }
    const last = Math.floor(Math.min(left_px + width, timeline.duration_s * px_s) / TILE_PX);
    for (let n = Math.floor(left_px / TILE_PX); n <= last; n++) {
      if (!this.tiles.has(n)) this.tiles.set(n, this.tile(n));
      pen.drawImage(this.tiles.get(n), n * TILE_PX - left_px, 0, TILE_PX, height);
    }
    for (const n of this.tiles.keys()) if (this.tiles.size > TILES) this.tiles.delete(n);
  }

  tile(number) {
    const { px_s } = this.timeline, tile = document.createElement("canvas"), column = new Float64Array(ROWS);
    tile.width = TILE_PX;
    tile.height = ROWS;
    const pen = tile.getContext("2d"), image = pen.createImageData(TILE_PX, ROWS);
    pen.fillStyle = colour.ink;
    pen.fillRect(0, 0, 1, 1);
    const [red, green, blue] = pen.getImageData(0, 0, 1, 1).data;
    for (let x = 0; x < TILE_PX; x++) {
      const time_s = (number * TILE_PX + x + 0.5) / px_s;
      if (time_s > this.of.duration_s) break;
      this.spectra.darkness(time_s, column);
      for (let row = 0; row < ROWS; row++) image.data.set([red, green, blue, 230 * column[row] ** 1.4], 4 * ((ROWS - 1 - row) * TILE_PX + x));
    }
    pen.putImageData(image, 0, 0);
    return tile;
  }
}

/** Return the confidence that is least, and that of which half of the recording has less; a recording that is sure has no doubt. */
function quantiles(curves) {
  const values = Float32Array.from(curves.values).sort(), at = (share) => values[Math.floor(share * (values.length - 1))];
  return [at(0.03), Math.min(at(0.5), 0.95)];
}

/** How sure the motion is, as a strip: the less, the darker. */
export class ConfidenceStrip {
  constructor(timeline) {
    this.timeline = timeline;
    this.selectable = true;
    this.canvas = make("canvas", { role: "img", "aria-label": TEXT.confidence });
    const explain = () => timeline.studio.say(TEXT.confidenceOf);
    this.element = make("div", { className: "track confidence" }, this.canvas,
      make("button", { type: "button", className: "label", textContent: TEXT.confidenceLegend, title: TEXT.confidenceOf, onclick: explain, onfocus: explain }));
  }

  draw() {
    const { timeline, timeline: { width, store: { confidence } } } = this, pen = cleared(this.canvas, width, STRIP_HEIGHT_PX);
    pen.fillStyle = colour.doubt;
    if (!confidence?.frames) return;
    if (this.of !== confidence) this.levels = quantiles(this.of = confidence);
    const [least, sure] = this.levels;
    const level = (x) => Math.round(SHADES * Math.min(Math.max((sure - confidence.at((timeline.left_px + x) / timeline.px_s, 0)) / (sure - least + 1e-6), 0), 1));
    const end = Math.min(width, timeline.x(timeline.duration_s));
    for (let x = 0, from = 0, shade = level(0); x <= end; x += STRIP_PX) {
      const next = x + STRIP_PX > end ? -1 : level(x);
      if (next === shade) continue;
      pen.globalAlpha = shade / SHADES;
      if (shade) pen.fillRect(from, 1, x - from, STRIP_HEIGHT_PX - 2);
      [from, shade] = [x, next];
    }
    pen.globalAlpha = 1;
  }
}
