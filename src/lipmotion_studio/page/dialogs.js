// The panels that open over the page: keys, export.

import { choice, labelled, made, textButton } from "./dom.js";
import { HELP, TEXT, filled } from "./strings.js";
import { KEYS } from "./keys.js";

export function dialog(title, ...children) {
  const shown = made("dialog", { "aria-label": title }, made("div", { className: "bar" }, made("h2", { textContent: title }),
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
  dialog(TEXT.help, made("div", { className: "keys" }, ...groups.map(([group, keys]) => made("section", {}, made("h3", { textContent: HELP[group] }),
    made("dl", {}, ...keys.flatMap(({ shown, help }) => [made("dt", {}, ...shown.map((key) => made("kbd", { textContent: key }))), made("dd", { textContent: HELP[help] })]))))));
}

/** @param {import("./studio.js").Studio} studio */
export function showExport(studio) {
  const { project, lines, line, face } = studio.store, presets = project.forms.presets;
  let chosen = project.forms.preset || presets[0].name;
  const was = lines.find(({ id }) => id === line?.id)?.exported;
  const told = made("p", { role: "status", className: "hint", textContent: was ? TEXT.wasExported[was] : "" }), approved = lines.filter(({ mark }) => mark === "approved").length;
  const about = made("p", { className: "hint" });
  const describe = () => { about.textContent = presets.find(({ name }) => name === chosen).files.join("  "); };
  const run = (act) => async () => {
    told.textContent = TEXT.saving;
    try {
      const { exported = [], failed = [] } = await act(chosen);
      told.textContent = [exported.length ? filled(TEXT.exported, { files: shortened(exported.flatMap(({ files }) => files)) }) : "",
        ...failed.map(({ error }) => error)].filter(Boolean).join(" ");
    } catch (error) {
      told.textContent = error.message;
    }
    await studio.listed();
  };
  describe();
  dialog(TEXT.exportTitle,
    labelled(TEXT.preset, choice(presets.map(({ name, title }) => [name, title ?? name]), chosen, (name) => {
      chosen = name;
      describe();
    }, { id: "preset" })), about,
    made("div", { className: "row" },
      textButton(TEXT.exportThis, run((preset) => studio.server.told(`lines/${line.id}/export`, { preset, face })), { id: "export-this", disabled: !line?.phones.length, className: "main" }),
      textButton(filled(TEXT.exportApproved, { count: approved }), run((preset) => studio.server.told("export", { preset, face, only: "approved" })), { id: "export-approved", disabled: !approved })),
    told);
}
