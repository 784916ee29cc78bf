"""The table of all bad inputs as Markdown, written by ``PYTHONPATH=tests python -m robustness.document``."""

from itertools import groupby
from pathlib import Path

from robustness import (
    corpus_cases,
    face_cases,
    model_cases,
    motion_cases,
    option_cases,
    speech_cases,
    spoken_cases,
    text_cases,
    video_cases,
)
from robustness.case import CASES

MODULES = (
    speech_cases, spoken_cases, text_cases, motion_cases, model_cases, face_cases, corpus_cases, option_cases,
    video_cases,
)  # fmt: skip
DOCUMENT = Path(__file__).parent / "table.md"
HEAD = """# Bad input, row by row

Every row is a test: one command line in an empty folder. Written by `PYTHONPATH=tests python -m robustness.document`.
Codes: 0 done, 3 unusable input, 4 corpus, 5 alignment, 6 model file, 7 output. General rules:
[docs/robustness.md](../../docs/robustness.md).
"""


def rendered() -> str:
    lines = [HEAD]
    for group, cases in groupby(sorted(CASES, key=lambda case: case.group), key=lambda case: case.group):
        lines += [f"### {group.capitalize()}", "", "| input | exit code | words of the message |", "|---|---|---|"]
        for case in cases:
            words = " … ".join(case.messages).replace("|", "\\|") or "(accepted)"
            lines.append(f"| {case.name.replace('|', chr(92) + '|')} | {case.code} | {words} |")
        lines.append("")
    return "\n".join(lines)


def main() -> None:
    DOCUMENT.write_text(rendered(), encoding="utf-8")


if __name__ == "__main__":
    main()
