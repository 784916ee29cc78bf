// Spectra of short windows: what a broadband spectrogram shows.

const WINDOW_S = 0.006, HIGHEST_HZ = 6000, RANGE_DB = 55, EMPHASIS = 0.95, LOOKED_AT = 600;
export const ROWS = 64;

export class Spectra {
  /** @param {import("./samples.js").Samples} samples */
  constructor(samples) {
    this.samples = samples;
    const width = Math.round(WINDOW_S * samples.rate_hz);
    this.size = 2 ** Math.ceil(Math.log2(Math.max(width, 128)));
    this.window = Float64Array.from({ length: width }, (_, n) => Math.exp(-12 * ((n + 0.5) / width - 0.5) ** 2));
    this.real = new Float64Array(this.size);
    this.imaginary = new Float64Array(this.size);
    this.turns = Float64Array.from({ length: this.size / 2 }, (_, n) => (-2 * Math.PI * n) / this.size);
    this.cosines = this.turns.map(Math.cos);
    this.sines = this.turns.map(Math.sin);
    this.column = new Float64Array(ROWS);
    this.loudest = -Infinity;
    for (let n = 0; n < LOOKED_AT; n++) {
      for (const level of this.levels((samples.duration_s * (n + 0.5)) / LOOKED_AT)) this.loudest = Math.max(this.loudest, level);
    }
  }

  /** Levels in dB from low frequencies to high ones, at a time; the array is used again. */
  levels(time_s) {
    const { real, imaginary, window, size, samples: { values, rate_hz } } = this;
    const first = Math.round(time_s * rate_hz - window.length / 2);
    real.fill(0);
    imaginary.fill(0);
    for (let n = 0; n < window.length; n++) {
      const now = values[first + n] ?? 0, before = values[first + n - 1] ?? 0;
      real[n] = (now - EMPHASIS * before) * window[n];
    }
    this.transform();
    const highest = Math.min(HIGHEST_HZ, rate_hz / 2);
    for (let row = 0; row < ROWS; row++) {
      const place = Math.min(((row + 0.5) / ROWS) * highest * (size / rate_hz), size / 2 - 1), bin = Math.floor(place);
      const share = place - bin, power = (n) => real[n] * real[n] + imaginary[n] * imaginary[n];
      this.column[row] = 10 * Math.log10((1 - share) * power(bin) + share * power(bin + 1) + 1e-6);
    }
    return this.column;
  }

  /** Darkness of each row at a time, 0 to 1. */
  darkness(time_s, out) {
    const levels = this.levels(time_s);
    for (let row = 0; row < ROWS; row++) out[row] = Math.min(Math.max(1 + (levels[row] - this.loudest) / RANGE_DB, 0), 1);
    return out;
  }

  /** The fast Fourier transform, in place (Cooley and Tukey 1965). */
  transform() {
    const { real, imaginary, size, cosines, sines } = this;
    for (let n = 1, mirrored = 0; n < size; n++) {
      let bit = size >> 1;
      for (; mirrored & bit; bit >>= 1) mirrored ^= bit;
      mirrored ^= bit;
      if (n < mirrored) {
        [real[n], real[mirrored]] = [real[mirrored], real[n]];
        [imaginary[n], imaginary[mirrored]] = [imaginary[mirrored], imaginary[n]];
      }
    }
    for (let half = 1; half < size; half *= 2) {
      const step = size / (2 * half);
      for (let start = 0; start < size; start += 2 * half) {
        for (let n = 0; n < half; n++) {
          const cosine = cosines[n * step], sine = sines[n * step], a = start + n, b = a + half;
          const re = real[b] * cosine - imaginary[b] * sine, im = real[b] * sine + imaginary[b] * cosine;
          real[b] = real[a] - re;
          imaginary[b] = imaginary[a] - im;
          real[a] += re;
          imaginary[a] += im;
        }
      }
    }
  }
}
