// The panels that open over the page: keys, export.

import { choice, labelled, make, textButton } from "./dom.js";
import { HELP, TEXT, fill } from "./strings.js";
import { KEYS } from "./keys.js";

export function dialog(title, ...children) {
  const shown = make("dialog", { "aria-label": title }, make("div", { className: "bar" }, make("h2", { textContent: title }),
    textButton(TEXT.close, () => shown.close(), { className: "close" })), ...children);
  shown.addEventListener("close", () => shown.remove());
  shown.addEventListener("click", (event) => { if (event.target === shown) shown.close(); });
  document.body.append(shown);
  shown.showModal();
  return shown;
}

const MOST_NAMED = 6;
const shortened = (files) => (files.length > MOST_NAMED ? [...files.slice(0, MOST_NAMED), `… (${files.length})`] : files).join(", ");

export function showKeys() {
  const groups = Object.entries(Object.groupBy(KEYS, ({ group }) => group));
  dialog(TEXT.help, make("div", { className: "keys" }, ...groups.map(([group, keys]) => make("section", {}, make("h3", { textContent: HELP[group] }),
    make("dl", {}, ...keys.flatMap(({ shown, help }) => [make("dt", {}, ...shown.map((key) => make("kbd", { textContent: key }))), make("dd", { textContent: HELP[help] })]))))));
}

/** @param {import("./studio.js").Studio} studio */
export function showExport(studio) {
  const { project, recordings, recording, face } = studio.store, presets = project.forms.presets;
  let chosen = project.forms.preset || presets[0].name;
  const was = recordings.find(({ id }) => id === recording?.id)?.exported;
  const note = make("p", { role: "status", className: "hint", textContent: was ? TEXT.wasExported[was] : "" }), approved = recordings.filter(({ mark }) => mark === "approved").length;
  const about = make("p", { className: "hint" });
  const describe = () => { about.textContent = presets.find(({ name }) => name === chosen).files.join("  "); };
  const run = (act) => async () => {
    note.textContent = TEXT.saving;
    try {
      const { exported = [], failed = [] } = await act(chosen);
      note.textContent = [exported.length ? fill(TEXT.exported, { files: shortened(exported.flatMap(({ files }) => files)) }) : "",
        ...failed.map(({ error }) => error)].filter(Boolean).join(" ");
    } catch (error) {
      note.textContent = error.message;
    }
    await studio.reloadList();
  };
  describe();
  dialog(TEXT.exportTitle,
    labelled(TEXT.preset, choice(presets.map(({ name, title }) => [name, title ?? name]), chosen, (name) => {
      chosen = name;
      describe();
    }, { id: "preset" })), about,
    make("div", { className: "row" },
      textButton(TEXT.exportThis, run((preset) => studio.server.post(`lines/${recording.id}/export`, { preset, face })), { id: "export-this", disabled: !recording?.phones.length, className: "main" }),
      textButton(fill(TEXT.exportApproved, { count: approved }), run((preset) => studio.server.post("export", { preset, face, only: "approved" })), { id: "export-approved", disabled: !approved })),
    note);
}
