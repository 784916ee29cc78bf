// HeadAudio (npm @met4citizen/headaudio): visemes of sound as it comes. node headaudio.mjs JOB.json ANSWER.json
// settings: those of its processor (`vadGateActiveDb`, `speakerMeanHz`, …), and `mends_aa`.

import { readFileSync } from "node:fs";
import { AudioWorkletNode, STEP_MS, folderOf, load, run } from "./jobs.mjs";

globalThis.AudioWorkletNode = AudioWorkletNode;
const folder = folderOf("@met4citizen/headaudio");
const { HeadAudio } = await load(`${folder}/modules/headaudio.mjs`);
const { Processor } = await load(`${folder}/modules/processor.mjs`);
const model = `data:;base64,${readFileSync(`${folder}/dist/model-en-mixed.bin`).toString("base64")}`;

await run(async ({ mends_aa, ...parameterData }, sampleRate) => {
  const processorOptions = { visemeEventsEnabled: Boolean(mends_aa) };
  const node = new HeadAudio(null, { processorOptions, parameterData });
  const processor = new Processor({ sampleRate, processorOptions, parameterData }, { port: node.far });
  processor.update(parameterData); // as its worklet does at the first sound
  node.far.onmessage = (message) => processor._onmessage(message);
  await node.loadModel(model);
  const weights = Object.fromEntries(node.visemeNames.map((name) => [name, 0]));
  node.onvalue = (name, value) => { weights[name] = value; };
  if (mends_aa) node.onviseme = ({ viseme }) => { if (viseme === 0) node.visemeActive = 0; }; // version 0.1.0 takes it for none
  return {
    hear: (quantum) => processor.process(quantum),
    weights: () => {
      node.update(STEP_MS);
      return weights;
    },
  };
});
