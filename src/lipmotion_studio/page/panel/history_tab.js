// The edits of the recording, newest first, and the comparison with another motion.

import { compareSection } from "../compare/compare_section.js";
import { make, row, section, textButton } from "../dom.js";
import { TEXT } from "../strings.js";

export function historyTab(studio) {
  const { recording } = studio.store;
  if (!recording) return [];
  return [
    section(TEXT.history,
      row(textButton(TEXT.undo, () => studio.undo(), { id: "undo-here", disabled: !recording.undo }), textButton(TEXT.redo, () => studio.redo(), { id: "redo-here", disabled: !recording.redo })),
      recording.steps.length ? make("ol", { className: "list steps", reversed: true }, ...recording.steps.map((step, n) => make("li", { value: n + 1, textContent: step })).reverse())
        : make("p", { className: "hint", textContent: TEXT.noHistory })),
    compareSection(studio),
  ];
}
