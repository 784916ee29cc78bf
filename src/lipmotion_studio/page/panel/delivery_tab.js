// How the motion is delivered: fields from the forms of the server.

import { choice, labelled, make, section } from "../dom.js";
import { placed, say } from "../sentences.js";
import { TEXT } from "../strings.js";

/** A range wider than this has a field of numbers. */
const WIDEST_SLIDER = 10;

export function deliveryTab(studio) {
  const { project, recording } = studio.store, set = placed(recording?.steps ?? []).set;
  if (!recording) return [];
  const shown = section(TEXT.settings, ...project.forms.controls.filter(({ name }) => name !== "mood").map((form) => field(studio, form, set[form.name] ?? form.usual)));
  shown.className = "settings";
  return [shown];
}

function field(studio, { name, kind, least, most, choices, help }, value) {
  const title = TEXT.delivery[name] ?? name.replaceAll("_", " ");
  const id = `set-${name}`, change = (to) => studio.edit([say.set(name, to)]);
  if (kind === "bool") {
    return labelled(title, make("input", { id, type: "checkbox", checked: String(value) === "true", onchange: (event) => change(event.target.checked ? "true" : "false") }));
  }
  if (choices) return labelled(title, choice(choices.map((each) => [each, each]), value, change, { id, title: help ?? "" }));
  if (least === null || most === null || most - least > WIDEST_SLIDER) {
    return labelled(title, make("input", { id, type: kind === "str" ? "text" : "number", step: "any", min: least ?? "", max: most ?? "", value, title: help ?? "", onchange: (event) => change(event.target.value) }));
  }
  const shown = make("output", { textContent: String(value) });
  const slider = make("input", { id, type: "range", min: least, max: most, step: (most - least) / 100, value, "aria-label": title,
    title: help ?? "", oninput: () => { shown.textContent = slider.value; }, onchange: () => change(slider.value) });
  return labelled(title, slider, shown);
}
