// node spine_keys.mjs FOLDER_OF_SPINE_CORE FILE.json: prints the keys of attachments as Spine's runtime reads them, as JSON
import { readFileSync } from "fs";
import { pathToFileURL } from "url";

const { SkeletonJson, RegionAttachment } = await import(pathToFileURL(`${process.argv[2]}/dist/index.js`));
const loader = { newRegionAttachment: (skin, name, path) => new RegionAttachment(name, path) };
const data = new SkeletonJson(loader).readSkeletonData(readFileSync(process.argv[3], "utf8"));
const animation = data.findAnimation("speech");
const keys = animation.timelines.find((timeline) => timeline.attachmentNames);
const attachments = data.defaultSkin.getAttachments().map((entry) => entry.name);
console.log(
  JSON.stringify({
    version: data.version,
    slot: data.slots[keys.slotIndex].name,
    times: [...keys.frames],
    names: keys.attachmentNames,
    duration: animation.duration,
    attachments,
    audio: data.events.map((event) => event.audioPath),
  }),
);
