// The part of the panel that compares: with what, and how.

import { iconButton, make, row, section, textButton } from "../dom.js";
import { TEXT, fill } from "../strings.js";
import { OTHER } from "./comparison.js";

export function compareSection(studio) {
  const { store, comparison } = studio, { other, project, recording } = store, against = project?.forms.against;
  const kept = [textButton(TEXT.compareKeep, () => comparison.keep(), { id: "compare-keep" }),
    against && textButton(fill(TEXT.compareModel, { name: against }), () => comparison.with(OTHER), { id: "compare-model" })].filter(Boolean);
  return section(TEXT.compare, recording.versions.length ? make("ul", { className: "list versions" }, ...recording.versions.map((version) => versionRow(studio, version))) : null, other && make("p", { className: "hint", textContent: fill(TEXT.comparedWith, { name: other.name }) }),
    row(...kept), other && row(
      held(studio), ...Object.entries(TEXT.heads).map(([heads, name]) => textButton(name, () => comparison.toggle(heads), { id: `compare-${heads}`, disabled: !other.weights, "aria-pressed": String(store.heads === heads) })),
      textButton(TEXT.compareStop, () => comparison.stop(), { id: "compare-stop" })));
}

function versionRow(studio, version) {
  const { comparison, store: { other } } = studio, name = fill(TEXT.versionNamed, version);
  return make("li", {}, row(
    textButton(name, () => comparison.with(version.name), { id: version.name, "aria-pressed": String(other?.by === version.name) }),
    textButton(TEXT.versionBack, () => studio.restoreVersion(version), { id: `${version.name}-back`, title: TEXT.versionBackHint }),
    iconButton("remove", fill(TEXT.versionForget, { name }), () => comparison.forget(version.name), { id: `${version.name}-forget` })));
}

function held({ store }) {
  const hold = textButton(TEXT.compareShow, () => {}, { id: "compare-hold" }), show = (comparing) => () => store.set({ comparing });
  for (const [name, comparing] of [["pointerdown", true], ["pointerup", false], ["pointerleave", false], ["blur", false]]) hold.addEventListener(name, show(comparing));
  hold.addEventListener("keydown", (event) => { if (event.key === " ") { event.preventDefault(); event.stopPropagation(); show(true)(); } });
  hold.addEventListener("keyup", show(false));
  return hold;
}
