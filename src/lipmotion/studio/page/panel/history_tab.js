// The edits of the line, newest first, and the comparison with an earlier version.

import { choice, labelled, made, textButton } from "../dom.js";
import { TEXT, filled } from "../strings.js";
import { row, section } from "./panel.js";

export function historyTab(studio) {
  const { line, other } = studio.store;
  if (!line) return [];
  const versions = [["", TEXT.compareNothing], ["0", TEXT.compareStart],
    ...line.steps.slice(0, -1).map((step, n) => [String(n + 1), `${filled(TEXT.compareStep, { number: n + 1 })}: ${step}`])];
  const hold = textButton(TEXT.compareShow, () => {}, { id: "compare-hold", disabled: !other });
  const show = (comparing) => () => studio.store.set({ comparing });
  for (const [name, comparing] of [["pointerdown", true], ["pointerup", false], ["pointerleave", false], ["blur", false]]) hold.addEventListener(name, show(comparing));
  hold.addEventListener("keydown", (event) => { if (event.key === " ") { event.preventDefault(); event.stopPropagation(); show(true)(); } });
  hold.addEventListener("keyup", show(false));
  return [
    section(TEXT.history,
      row(textButton(TEXT.undo, () => studio.undo(), { id: "undo-here", disabled: !line.undo }), textButton(TEXT.redo, () => studio.redo(), { id: "redo-here", disabled: !line.redo })),
      line.steps.length ? made("ol", { className: "list steps", reversed: true }, ...line.steps.map((step, n) => made("li", { value: n + 1, textContent: step })).reverse())
        : made("p", { className: "hint", textContent: TEXT.noHistory })),
    line.steps.length > 0 && studio.store.project.forms.versions && section(TEXT.compare,
      row(labelled(TEXT.compare, choice(versions, other ? String(other.version) : "", (version) => studio.compare(version), { id: "compare" })), hold)),
  ].filter(Boolean);
}
