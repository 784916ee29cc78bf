// node vrm_animation.mjs FOLDER_OF_THREE_VRM_ANIMATION FILE.vrma: prints what three-vrm reads of it, as JSON
import { readFileSync } from "fs";
import { pathToFileURL } from "url";

const load = (path) => import(pathToFileURL(`${process.argv[2]}/${path}`));
const { VRMAnimationLoaderPlugin } = await load("lib/three-vrm-animation.module.js");
const { GLTFLoader } = await load("../../three/examples/jsm/loaders/GLTFLoader.js");
const warnings = [];
console.warn = (...words) => warnings.push(words.join(" "));
const content = readFileSync(process.argv[3]);
const bytes = content.buffer.slice(content.byteOffset, content.byteOffset + content.length);
const loader = new GLTFLoader();
loader.register((parser) => new VRMAnimationLoaderPlugin(parser));
const gltf = await loader.parseAsync(bytes, "");
const [animation] = gltf.userData.vrmAnimations;
const kept = (tracks) =>
  Object.fromEntries([...tracks].map(([name, track]) => [name, { times: [...track.times], values: [...track.values] }]));
console.log(
  JSON.stringify({
    warnings,
    duration: animation.duration,
    hips: animation.restHipsPosition.toArray(),
    expressions: kept(animation.expressionTracks.preset),
    custom: kept(animation.expressionTracks.custom),
    rotations: kept(animation.humanoidTracks.rotation),
  }),
);
