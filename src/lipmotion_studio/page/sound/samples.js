// The samples of a recording: read from WAV, and their extremes at several widths, so that any stretch is drawn at once.

const STEP = 64;

export class Samples {
  /**
   * @param {Int16Array} values  of one channel
   * @param {number} rate_hz
   */
  constructor(values, rate_hz) {
    this.values = values;
    this.rate_hz = rate_hz;
    this.duration_s = values.length / rate_hz;
    this.levels = [];
    for (let below = null, width = STEP; width < values.length; width *= STEP) {
      below = narrowed(below ?? { lowest: values, highest: values });
      this.levels.push({ width, ...below });
    }
    this.loudest = 1;
    const top = this.levels.at(-1);
    if (top) for (let n = 0; n < top.lowest.length; n++) this.loudest = Math.max(this.loudest, -top.lowest[n], top.highest[n]);
  }

  /** Lowest and highest sample from one time to another, as shares of the loudest. */
  extremes(start_s, end_s) {
    const first = Math.max(Math.floor(start_s * this.rate_hz), 0);
    const stop = Math.min(Math.max(Math.ceil(end_s * this.rate_hz), first + 1), this.values.length);
    const level = this.levels.findLast(({ width }) => width * 2 <= stop - first);
    const { lowest, highest, width } = level ?? { lowest: this.values, highest: this.values, width: 1 };
    let least = Infinity, most = -Infinity;
    for (let n = Math.floor(first / width); n < Math.ceil(stop / width); n++) {
      if (lowest[n] < least) least = lowest[n];
      if (highest[n] > most) most = highest[n];
    }
    return least > most ? [0, 0] : [least / this.loudest, most / this.loudest];
  }
}

function narrowed({ lowest, highest }) {
  const length = Math.ceil(lowest.length / STEP), low = new Int16Array(length), high = new Int16Array(length);
  for (let n = 0; n < length; n++) {
    let least = 32767, most = -32768;
    for (let place = n * STEP; place < Math.min((n + 1) * STEP, lowest.length); place++) {
      if (lowest[place] < least) least = lowest[place];
      if (highest[place] > most) most = highest[place];
    }
    low[n] = least;
    high[n] = most;
  }
  return { lowest: low, highest: high };
}

/** Return the samples of a WAV file of 16 bits and one channel. */
export function samplesOf(buffer) {
  const { start, count, rate_hz } = partsOf(buffer);
  return new Samples(new Int16Array(buffer, start, count), rate_hz);
}

/** Where the samples of a WAV file of 16 bits and one channel start, in bytes, how many there are, and their rate. */
function partsOf(buffer) {
  const view = new DataView(buffer);
  let rate_hz = 0;
  for (let place = 12; place + 8 <= buffer.byteLength;) {
    const name = view.getUint32(place), size = view.getUint32(place + 4, true);
    if (name === 0x666d7420) rate_hz = view.getUint32(place + 12, true); // "fmt "
    if (name === 0x64617461) return { start: place + 8, count: Math.min(size, buffer.byteLength - place - 8) >> 1, rate_hz }; // "data"
    place += 8 + size + (size & 1);
  }
  throw new Error("no WAV file");
}
