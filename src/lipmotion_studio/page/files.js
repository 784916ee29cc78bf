// Files that are dropped on the page: recordings, with their scripts.

import { TEXT, countRecordings, fill } from "./strings.js";

const SOUND = /\.(wav|flac|mp3|ogg|opus|m4a|aac|aif|aiff|mp4|mov|mkv|webm|avi)$/i, SCRIPT = /\.(txt|lab)$/i, AT_ONCE = 3;
const stem = (name) => name.replace(/\.[^.]*$/, "");

/** Return the files of a drop, those in folders too. */
async function filesOf(dropped) {
  if (Array.isArray(dropped)) return dropped;
  const entries = [...dropped.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
  if (!entries.length) return [...dropped.files];
  const found = [];
  const walk = async (entry) => {
    if (entry.isFile) return found.push(await new Promise((done, failed) => { entry.file(done, failed); }));
    const reader = entry.createReader();
    for (;;) {
      const some = await new Promise((done, failed) => { reader.readEntries(done, failed); });
      if (!some.length) return undefined;
      for (const each of some) await walk(each);
    }
  };
  for (const entry of entries) await walk(entry);
  return found.sort((a, b) => a.name.localeCompare(b.name, "en", { numeric: true }));
}

/**
 * Send recordings to the server, each with its script; return the first recording.
 * @param {any} dropped  files, or what a drop carries
 * @param {import("./studio.js").Studio} studio
 */
export async function addFiles(dropped, studio) {
  const files = await filesOf(dropped), recordings = files.filter(({ name }) => SOUND.test(name));
  const scripts = new Map(files.filter(({ name }) => SCRIPT.test(name)).map((file) => [stem(file.name), file]));
  const stems = new Set(recordings.map(({ name }) => stem(name)));
  const refused = [
    ...files.filter(({ name }) => !SOUND.test(name) && !SCRIPT.test(name)).map(({ name }) => fill(TEXT.notSound, { name })),
    ...[...scripts].filter(([name]) => !stems.has(name)).map(([, { name }]) => fill(TEXT.noRecording, { name })),
  ];
  studio.say(fill(TEXT.dropped, { count: countRecordings(recordings.length) }));
  const rows = [], waiting = recordings.map((file, n) => [file, n]);
  const work = async () => {
    for (let next = waiting.shift(); next; next = waiting.shift()) {
      const [file, n] = next, script = scripts.get(stem(file.name));
      const headers = script ? { "x-lipmotion-transcript": encodeURIComponent((await script.text()).trim()) } : {};
      try {
        rows[n] = await studio.server.post(`lines?name=${encodeURIComponent(file.name)}`, file, headers);
      } catch (error) {
        refused.push(`${file.name}: ${error.message}`);
      }
    }
  };
  await Promise.all(Array.from({ length: AT_ONCE }, work));
  const added = rows.filter(Boolean);
  studio.say([added.length ? fill(TEXT.added, { count: countRecordings(added.length) }) : "", ...refused].filter(Boolean).join(" "), refused.length ? "bad" : "");
  return added[0] ?? null;
}
