// Curves in time: frames by names.

export class Curves {
  /**
   * @param {string[]} names
   * @param {number} rate_hz
   * @param {Float32Array} values  frames by names
   * @param {number} first  number of the first frame, where they are a part of longer ones
   */
  constructor(names, rate_hz, values, first = 0) {
    this.names = names;
    this.rate_hz = rate_hz;
    this.values = values;
    this.first = first;
    this.frames = names.length ? values.length / names.length : 0;
  }

  column(name) { return this.names.indexOf(name); }

  /** The value of a column in a frame; past the ends, that of the first or last one. */
  value(frame, column) {
    const held = Math.min(Math.max(frame, 0), this.frames - 1);
    return this.values[held * this.names.length + column];
  }

  /** The value at a time, on a straight line between frames; a whole frame gives its value exactly. */
  at(time_s, column) {
    const place = time_s * this.rate_hz, frame = Math.floor(place + 1e-6), share = Math.max(place - frame, 0);
    const before = this.value(frame, column);
    return share < 1e-3 ? before : before + share * (this.value(frame + 1, column) - before);
  }

  /** Lowest and highest value of a column. */
  range(column) {
    let least = Infinity, most = -Infinity;
    for (let place = column; place < this.values.length; place += this.names.length) {
      least = Math.min(least, this.values[place]);
      most = Math.max(most, this.values[place]);
    }
    return [least, most];
  }

  /** Some of these curves alone, in this order; those that are not here are left out. */
  only(names) {
    const kept = names.filter((name) => this.names.includes(name)), columns = kept.map((name) => this.column(name));
    const values = new Float32Array(this.frames * kept.length);
    for (let frame = 0, place = 0; frame < this.frames; frame++) for (const column of columns) values[place++] = this.values[frame * this.names.length + column];
    return new Curves(kept, this.rate_hz, values, this.first);
  }

  /** These curves, and others of as many frames. */
  and(others) {
    if (!others.names.length) return this;
    if (!this.names.length) return others;
    const names = [...this.names, ...others.names], values = new Float32Array(this.frames * names.length);
    for (let frame = 0; frame < this.frames; frame++) {
      for (const [part, from] of [[this, 0], [others, this.names.length]]) {
        values.set(part.values.subarray(frame * part.names.length, (frame + 1) * part.names.length), frame * names.length + from);
      }
    }
    return new Curves(names, this.rate_hz, values);
  }

  /** Whether other curves are a part of these: the same names and rate, within their frames. */
  holds(part) {
    return part.rate_hz === this.rate_hz && part.first + part.frames <= this.frames && String(part.names) === String(this.names);
  }

  /** These curves with a part in place of what was there. */
  patched(part) {
    const values = this.values.slice();
    values.set(part.values, part.first * this.names.length);
    return new Curves(this.names, this.rate_hz, values);
  }
}
