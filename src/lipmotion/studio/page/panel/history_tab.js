// The edits of the line, newest first, and the comparison with an earlier version.

import { made, textButton } from "../dom.js";
import { TEXT, filled } from "../strings.js";
import { row, section } from "./panel.js";

export function historyTab(studio) {
  const { line, other } = studio.store;
  if (!line) return [];
  const hold = textButton(TEXT.compareShow, () => {}, { id: "compare-hold" });
  const show = (comparing) => () => studio.store.set({ comparing });
  for (const [name, comparing] of [["pointerdown", true], ["pointerup", false], ["pointerleave", false], ["blur", false]]) hold.addEventListener(name, show(comparing));
  hold.addEventListener("keydown", (event) => { if (event.key === " ") { event.preventDefault(); event.stopPropagation(); show(true)(); } });
  hold.addEventListener("keyup", show(false));
  return [
    section(TEXT.history,
      row(textButton(TEXT.undo, () => studio.undo(), { id: "undo-here", disabled: !line.undo }), textButton(TEXT.redo, () => studio.redo(), { id: "redo-here", disabled: !line.redo })),
      line.steps.length ? made("ol", { className: "list steps", reversed: true }, ...line.steps.map((step, n) => made("li", { value: n + 1, textContent: step })).reverse())
        : made("p", { className: "hint", textContent: TEXT.noHistory })),
    section(TEXT.compare, other && made("p", { className: "hint", textContent: other.steps ? filled(TEXT.compareStep, { number: other.steps }) : TEXT.compareStart }),
      row(textButton(TEXT.compareKeep, () => studio.compare(true), { id: "compare-keep" }), other && hold,
        other && textButton(TEXT.compareStop, () => studio.compare(false), { id: "compare-stop" }))),
  ];
}
