// wawa-lipsync (npm wawa-lipsync): one viseme at a time. node wawa.mjs JOB.json ANSWER.json; settings: `fftSize`, `historySize`.
// It asks a browser's AnalyserNode for the spectrum, which is written here after the specification of Web Audio.

import { createRequire } from "node:module";
import { folderOf, run } from "./jobs.mjs";

const STEP_S = 1 / 60, SMOOTHING = 0.8, LOWEST_DB = -100, HIGHEST_DB = -30;

/** Magnitudes of the discrete Fourier transform of real samples, a power of two of them. */
function spectrum(samples) {
  const size = samples.length, re = Float64Array.from(samples), im = new Float64Array(size);
  for (let i = 1, j = 0; i < size; i++) {
    let bit = size >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) [re[i], re[j]] = [re[j], re[i]];
  }
  for (let length = 2; length <= size; length <<= 1) {
    for (let k = 0; k < length / 2; k++) {
      const angle = -2 * Math.PI * k / length, cos = Math.cos(angle), sin = Math.sin(angle);
      for (let start = k; start < size; start += length) {
        const other = start + length / 2, x = re[other] * cos - im[other] * sin, y = re[other] * sin + im[other] * cos;
        re[other] = re[start] - x; im[other] = im[start] - y;
        re[start] += x; im[start] += y;
      }
    }
  }
  return Float64Array.from({ length: size / 2 }, (_, k) => Math.hypot(re[k], im[k]) / size);
}

class Analyser {
  set fftSize(size) {
    Object.assign(this, { size, frequencyBinCount: size / 2, heard: new Float32Array(size), smoothed: new Float64Array(size / 2) });
    const turn = 2 * Math.PI / size; // Blackman's window, α 0.16
    this.window = Float64Array.from({ length: size }, (_, n) => 0.42 - 0.5 * Math.cos(turn * n) + 0.08 * Math.cos(2 * turn * n));
  }
  hear(quantum) {
    this.heard.copyWithin(0, quantum.length);
    this.heard.set(quantum, this.size - quantum.length);
  }
  getByteFrequencyData(bytes) {
    spectrum(this.window.map((weight, n) => weight * this.heard[n])).forEach((magnitude, k) => {
      this.smoothed[k] = SMOOTHING * this.smoothed[k] + (1 - SMOOTHING) * magnitude;
      const level = 255 / (HIGHEST_DB - LOWEST_DB) * (20 * Math.log10(this.smoothed[k]) - LOWEST_DB);
      bytes[k] = Math.max(0, Math.min(255, Math.floor(level)));
    });
  }
}

let sampleRate, now_ms;
globalThis.window = { AudioContext: class { sampleRate = sampleRate; createAnalyser() { return new Analyser(); } } };
Object.defineProperty(globalThis, "performance", { value: { now: () => now_ms } });

await run(async (settings, rate_hz) => {
  const { Lipsync, VISEMES } = createRequire(import.meta.url)(folderOf("wawa-lipsync"));
  [sampleRate, now_ms] = [rate_hz, 0];
  const rival = new Lipsync(settings);
  let heard = 0, asked = 0;
  return {
    hear: (quantum) => {
      rival.analyser.hear(quantum);
      heard += quantum.length;
      now_ms = 1000 * heard / rate_hz;
      if (now_ms / 1000 < asked * STEP_S) return; // as a browser draws its pictures
      asked++;
      rival.processAudio();
    },
    weights: () => Object.fromEntries(Object.values(VISEMES).map((name) => [name, Number(name === rival.viseme)])),
  };
});
