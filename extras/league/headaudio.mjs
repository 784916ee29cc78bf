// HeadAudio (npm @met4citizen/headaudio): visemes of sound as it comes. node headaudio.mjs JOB.json ANSWER.json
// settings: those of its processor (`speakerMeanHz`, …); with `vadGateActiveDb` its gate opens there and shuts 10 dB below.

import { readFileSync } from "node:fs";
import { AudioWorkletNode, STEP_MS, folderOf, load, run } from "./jobs.mjs";

globalThis.AudioWorkletNode = AudioWorkletNode;
const folder = folderOf("@met4citizen/headaudio");
const { HeadAudio } = await load(`${folder}/modules/headaudio.mjs`);
const { Processor } = await load(`${folder}/modules/processor.mjs`);
const model = `data:;base64,${readFileSync(`${folder}/dist/model-en-mixed.bin`).toString("base64")}`;

await run(async (settings, sampleRate) => {
  const processorOptions = {}, parameterData = { vadMode: 1, vadGateInactiveDb: settings.vadGateActiveDb - 10, ...settings };
  const node = new HeadAudio(null, { processorOptions, parameterData });
  const processor = new Processor({ sampleRate, processorOptions, parameterData }, { port: node.far });
  processor.update(parameterData); // as its worklet does at the first sound
  node.far.onmessage = (message) => processor._onmessage(message);
  await node.loadModel(model);
  const weights = Object.fromEntries(node.visemeNames.map((name) => [name, 0]));
  node.onvalue = (name, value) => { weights[name] = value; };
  return {
    hear: (quantum) => processor.process(quantum),
    weights: () => {
      node.update(STEP_MS);
      return weights;
    },
  };
});
