// How the motion is delivered: fields from the forms of the server.

import { choice, labelled, made, section } from "../dom.js";
import { placed, say } from "../sentences.js";
import { TEXT } from "../strings.js";

/** A range wider than this has a field of numbers. */
const WIDEST_SLIDER = 10;

export function deliveryTab(studio) {
  const { project, line } = studio.store, set = placed(line?.steps ?? []).set;
  if (!line) return [];
  const shown = section(TEXT.settings, ...project.forms.controls.filter(({ name }) => name !== "mood").map((form) => field(studio, form, set[form.name] ?? form.usual)));
  shown.className = "settings";
  return [shown];
}

function field(studio, { name, kind, least, most, choices, help }, value) {
  const title = TEXT.delivery[name] ?? name.replaceAll("_", " ");
  const id = `set-${name}`, change = (to) => studio.edit([say.set(name, to)]);
  if (kind === "bool") {
    return labelled(title, made("input", { id, type: "checkbox", checked: String(value) === "true", onchange: (event) => change(event.target.checked ? "true" : "false") }));
  }
  if (choices) return labelled(title, choice(choices.map((each) => [each, each]), value, change, { id, title: help ?? "" }));
  if (least === null || most === null || most - least > WIDEST_SLIDER) {
    return labelled(title, made("input", { id, type: kind === "str" ? "text" : "number", step: "any", min: least ?? "", max: most ?? "", value, title: help ?? "", onchange: (event) => change(event.target.value) }));
  }
  const shown = made("output", { textContent: String(value) });
  const slider = made("input", { id, type: "range", min: least, max: most, step: (most - least) / 100, value, "aria-label": title,
    title: help ?? "", oninput: () => { shown.textContent = slider.value; }, onchange: () => change(slider.value) });
  return labelled(title, slider, shown);
}
