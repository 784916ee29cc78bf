// The edits of the line, newest first, and the comparison with another motion.

import { compareSection } from "../compare/compare_section.js";
import { made, row, section, textButton } from "../dom.js";
import { TEXT } from "../strings.js";

export function historyTab(studio) {
  const { line } = studio.store;
  if (!line) return [];
  return [
    section(TEXT.history,
      row(textButton(TEXT.undo, () => studio.undo(), { id: "undo-here", disabled: !line.undo }), textButton(TEXT.redo, () => studio.redo(), { id: "redo-here", disabled: !line.redo })),
      line.steps.length ? made("ol", { className: "list steps", reversed: true }, ...line.steps.map((step, n) => made("li", { value: n + 1, textContent: step })).reverse())
        : made("p", { className: "hint", textContent: TEXT.noHistory })),
    compareSection(studio),
  ];
}
