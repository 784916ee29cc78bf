"""The table of docs/robustness.md, written by ``python -m robustness.document``."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

from robustness import corpus_cases, model_cases, motion_cases, option_cases, speech_cases, text_cases, video_cases
from robustness.case import CASES

MODULES = (speech_cases, text_cases, motion_cases, model_cases, corpus_cases, option_cases, video_cases)
DOCUMENT = Path(__file__).parents[2] / "docs" / "robustness.md"
BEGIN, END = "<!-- begin: written by tests/robustness/document.py -->\n", "<!-- end -->\n"


def rendered() -> str:
    """Return the table, by class."""
    lines = []
    for group, cases in groupby(sorted(CASES, key=lambda case: case.group), key=lambda case: case.group):
        lines += [f"### {group.capitalize()}", "", "| input | exit code | words of the message |", "|---|---|---|"]
        for case in cases:
            said = " … ".join(case.says).replace("|", "\\|") or "(accepted)"
            lines.append(f"| {case.name.replace('|', chr(92) + '|')} | {case.code} | {said} |")
        lines.append("")
    return BEGIN + "\n" + "\n".join(lines) + END


def main() -> None:
    """Write the table into the document."""
    text = DOCUMENT.read_text(encoding="utf-8")
    before, after = text.partition(BEGIN)[0], text.partition(END)[2]
    DOCUMENT.write_text(before + rendered() + after, encoding="utf-8")


if __name__ == "__main__":
    main()
