// wLipSync (npm wlipsync): vowels of sound as it comes. node wlipsync.mjs JOB.json ANSWER.json
// settings: `profile`, the file of one (its repository has example/profile.bin), `minVolume`, `maxVolume`, `smoothness`.

import { readFileSync } from "node:fs";
import { AudioWorkletNode, QUANTUM, folderOf, load, run } from "./jobs.mjs";

let node, Processor;
globalThis.AudioWorkletNode = AudioWorkletNode;
globalThis.AudioWorkletProcessor = class { port = node.far; };
globalThis.registerProcessor = (_, processor) => { Processor = processor; };
const folder = folderOf("wlipsync");
await load(`${folder}/dist/audio-processor.js`);
const { WLipSyncAudioNode, parseBinaryProfile } = await load(`${folder}/dist/wlipsync.js`);
const wasmModule = await WebAssembly.compile(readFileSync(`${folder}/dist/wlipsync.wasm`));

await run(async ({ profile, blockSize = 512, ...settings }, rate_hz) => {
  const file = readFileSync(profile), parameters = { blockSize: [blockSize] };
  const read = profile.endsWith(".json") ? JSON.parse(file) : parseBinaryProfile(Uint8Array.from(file).buffer);
  Object.assign(globalThis, { sampleRate: rate_hz, currentTime: 0 });
  node = Object.assign(new WLipSyncAudioNode(null, read, wasmModule), settings);
  const processor = new Processor(node.options);
  while (processor.inputBufferIndex === -1) await new Promise(setImmediate);
  processor.inputBuffer.fill(0); // its memory is that of the recording before
  return {
    hear: (quantum) => {
      globalThis.currentTime += QUANTUM / rate_hz;
      processor.process([[quantum]], [], parameters);
    },
    weights: () => Object.fromEntries(Object.entries(node.weights).map(([name, weight]) => [name, weight * node.volume])),
  };
});
