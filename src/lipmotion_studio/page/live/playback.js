// Sound and frames of a stream, in step: both are shown by one clock, that of the sound while it is heard.

/** How much later than the frames come at the latest they are shown; frames that are late for so long move everything back. */
const MARGIN_S = 0.08, LATE_S = 0.5;
/** After so long without a frame the mouth goes to rest, within so long. */
const STALE_S = 0.1, REST_S = 0.15;
/** So much sound is looked at to find out that it waits longer than it needs, by so much. */
const LOOKED_AT_S = 5, SPARE_S = 0.15;

export class Playback {
  constructor() {
    this.context = null;
    this.rest = []; // the values at rest
    this.begin({ rate_hz: 16000, look_ahead_ms: 160 });
  }

  /** A stream begins. */
  begin({ rate_hz, look_ahead_ms }) {
    this.stop();
    if (this.context && this.rate_hz !== rate_hz) {
      this.context.close();
      this.context = null;
    }
    this.rate_hz = rate_hz;
    this.delay_s = look_ahead_ms / 1000 + MARGIN_S;
    this.anchor_s = null; // the time on the clock of what is 0 in the stream
    this.late_since_s = Infinity;
    this.frames = [];
    this.pieces = []; // of sound: when it begins in the stream, and when it came
  }

  stop() {
    for (const source of this.sources ?? []) source.stop();
    this.sources = new Set();
  }

  get isHeard() { return this.context?.state === "running"; }

  /** The time on the clock: that of the sound while there is any, else that of the page, without a step between them. */
  get clock_s() { return this.isHeard ? this.context.currentTime + this.shift_s : performance.now() / 1000; }

  /** What of the stream is heard now. */
  get time_s() { return this.clock_s - this.anchor_s - (this.isHeard ? this.context.outputLatency || this.context.baseLatency || 0 : 0); }

  /** How long ago what is heard now came. */
  get behind_s() {
    const piece = this.pieces.findLast(({ begin_s }) => begin_s <= this.time_s);
    return piece ? this.clock_s - piece.came_s : null;
  }

  /** Let sound be heard, or not; return whether it is: browsers refuse until somebody has clicked. */
  async listen(isWanted) {
    if (!isWanted) {
      await this.context?.suspend();
      return false;
    }
    if (!this.context) {
      this.context = new AudioContext({ sampleRate: this.rate_hz });
      this.context.onstatechange = () => {
        this.stop();
        if (!this.isHeard) return;
        this.shift_s = performance.now() / 1000 - this.context.currentTime;
        if (this.anchor_s !== null) this.anchorAt(this.anchor_s);
      };
    }
    const refused = new Promise((resolve) => { setTimeout(resolve, 300); });
    await Promise.race([this.context.resume(), refused]);
    return this.isHeard;
  }

  /** Take sound. `samples`: whole numbers of 16 bits */
  hear(begin_s, samples) {
    const now_s = this.clock_s, ahead_s = this.anchor_s === null ? -1 : begin_s + this.anchor_s - now_s;
    if (ahead_s < 0) this.anchorAt(now_s + this.delay_s - begin_s);
    this.pieces.push({ begin_s, came_s: now_s, ahead_s });
    while (this.pieces[0].begin_s < this.time_s - 2 * LOOKED_AT_S) this.pieces.shift();
    this.catchUp(begin_s, now_s);
    if (this.isHeard) this.schedule(begin_s, samples);
  }

  anchorAt(anchor_s) {
    this.stop();
    const shift_s = this.isHeard ? this.shift_s : 0; // pieces of sound begin at whole samples, or one would hear the seams
    this.anchor_s = Math.round((anchor_s - shift_s) * this.rate_hz) / this.rate_hz + shift_s;
  }

  /** Where sound that comes no faster than it is spoken has waited longer than it must, go on with the newest. */
  catchUp(begin_s, now_s) {
    const looked = this.pieces.filter(({ came_s }) => came_s > now_s - LOOKED_AT_S);
    if (looked.length < 2 || now_s - this.pieces[0].came_s < LOOKED_AT_S || begin_s - looked[0].begin_s > 1.1 * LOOKED_AT_S) return;
    if (Math.min(...looked.map(({ ahead_s }) => ahead_s)) < this.delay_s + SPARE_S) return;
    this.anchorAt(now_s + this.delay_s - begin_s);
    this.pieces = [];
  }

  schedule(begin_s, samples) {
    const buffer = this.context.createBuffer(1, samples.length, this.rate_hz), source = this.context.createBufferSource();
    buffer.copyToChannel(Float32Array.from(samples, (value) => value / 32768), 0);
    source.buffer = buffer;
    source.connect(this.context.destination);
    source.onended = () => this.sources.delete(source);
    source.start(Math.max(begin_s + this.anchor_s - this.shift_s, 0));
    this.sources.add(source);
  }

  /** Take a frame: `time_s`, `values`. */
  take(frame) {
    this.frames.push(frame);
    this.dropPassed();
    const now_s = this.clock_s, late_s = this.anchor_s === null ? 0 : now_s - this.anchor_s - frame.time_s;
    if (late_s <= 0) this.late_since_s = Infinity;
    else if (this.late_since_s === Infinity) this.late_since_s = now_s;
    else if (now_s - this.late_since_s > LATE_S) {
      this.late_since_s = Infinity;
      this.delay_s += late_s + MARGIN_S;
      this.anchorAt(this.anchor_s + late_s + MARGIN_S);
    }
  }

  /** Forget the frames before the one that is shown now. */
  dropPassed() { while (this.frames.length > 1 && this.frames[1].time_s <= this.time_s) this.frames.shift(); }

  /** The values now, into an array; return whether there is anything to come. */
  read(values) {
    this.dropPassed();
    const { frames: [before, after = before], time_s } = this;
    if (!before || time_s < before.time_s) return Boolean(before);
    const span_s = after.time_s - before.time_s, share = span_s ? Math.min((time_s - before.time_s) / span_s, 1) : 0;
    const age_s = time_s - after.time_s, rest = Math.min(Math.max((age_s - STALE_S) / REST_S, 0), 1);
    for (let n = 0; n < values.length; n++) {
      const value = before.values[n] + share * (after.values[n] - before.values[n]);
      values[n] = value + rest * (this.rest[n] - value);
    }
    return rest < 1;
  }
}
