// What the adapters that run in node share: a job in, weights out, and the part of Web Audio that the rivals need.

import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

export const QUANTUM = 128, STEP_MS = 20;
const ABSENT = 8; // exit code: the rival is not installed

const [job, answer] = process.argv.slice(2);

/** The folder of a package of npm, in LIPMOTION_NODE_MODULES or here; without it the program ends. */
export function folderOf(name) {
  const folder = resolve(join(process.env.LIPMOTION_NODE_MODULES ?? "node_modules", name));
  if (!existsSync(folder)) process.exit(ABSENT);
  return folder;
}

export const load = (file) => import(pathToFileURL(file).href);

/** The samples of a WAV file of 16 bits and one channel, full scale 1. */
function readSamples(file) {
  const content = readFileSync(file), at = content.indexOf("data") + 8;
  return Float32Array.from(new Int16Array(content.buffer.slice(content.byteOffset + at)), (value) => value / 32768);
}

/** The weights of a rival after each 20 ms of sound, and its processor seconds. */
async function hearAll(rival, samples, rate_hz) {
  const start = process.cpuUsage(), times = [], weights = {};
  for (let first = 0, next_s = 0; first + QUANTUM <= samples.length; first += QUANTUM) {
    rival.hear(samples.subarray(first, first + QUANTUM));
    const heard_s = (first + QUANTUM) / rate_hz;
    if (heard_s < next_s) continue;
    times.push(heard_s);
    for (const [weight, value] of Object.entries(rival.weights())) (weights[weight] ??= []).push(value);
    next_s += STEP_MS / 1000;
  }
  const { user, system } = process.cpuUsage(start);
  return { times, weights, seconds: (user + system) / 1e6 };
}

/**
 * Answer the job of the command line.
 * @param {(settings: object, rate_hz: number) => Promise<{hear: (quantum: Float32Array) => void, weights: () => Record<string, number>}>} begin
 *   is called for each recording and each settings; `weights` after each 20 ms of sound
 */
export async function run(begin) {
  const { rate_hz, recordings, settings } = JSON.parse(readFileSync(job, "utf-8")), answers = {};
  for (const { name, sound } of recordings) {
    answers[name] = [];
    for (const each of settings) answers[name].push(await hearAll(await begin(each, rate_hz), readSamples(sound), rate_hz));
  }
  writeFileSync(answer, JSON.stringify(answers));
}

/** A node of Web Audio without Web Audio: what it posts is at once at `far`, the port of its processor, and the other way round. */
export class AudioWorkletNode {
  constructor(context, name, options) {
    this.options = options;
    this.port = { postMessage: (data) => this.far.onmessage?.({ data }) };
    this.far = { postMessage: (data) => this.port.onmessage?.({ data }) };
  }
}
