"""``tsv``: one line per cue with its start and its shape; the last line is the end, with the shape at rest.

Read are other tables of cues, too: with commas or semicolons, names of columns, ends of cues, clocks, decimal commas.
"""

from __future__ import annotations

import csv
import re
from itertools import pairwise

from lipmotion.errors import InputError
from lipmotion.export.cues.cue_lines import chart_of, cue_time, shape_of, sheet_of
from lipmotion.export.cues.sheet import CUES_FPS, CueSheet
from lipmotion.units.mouth_chart import LETTERS

HEADER = re.compile(r"\W*(?:time|start|begin|seconds)\b[^\n]*", re.IGNORECASE)
LONGEST_LINE = 200


def text(sheet: CueSheet, _sound_file: str) -> str:
    """Return the content of the file."""
    rows = [(cue.start_s, cue.label) for cue in sheet.cues]
    return "".join(f"{time_s:.2f}\t{shape}\n" for time_s, shape in [*rows, (sheet.duration_s, sheet.rest)])


def parse(text: str) -> CueSheet:
    """Return the cues of a file. Raises InputError: a line of another form, with its number."""
    numbered = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    if numbered and HEADER.match(numbered[0][1]):
        numbered = numbered[1:]
    mark = next((mark for mark in "\t;" if numbered and mark in numbered[0][1]), ",")
    cues: list[tuple[str, list[str]]] = []
    for number, line in numbered:
        fields = next(csv.reader([line], delimiter=mark, skipinitialspace=True)) if len(line) < LONGEST_LINE else []
        if not 2 <= len(fields) <= 3:
            raise InputError(f"line {number}: required a time, a tab and a mouth shape; or two times and a shape")
        cues.append((f"line {number}", fields))
    spans = [fields for _, fields in cues if len(fields) == 3]
    follow = all(before[1] == after[0] for before, after in pairwise(spans))
    if mark == "," and not follow and all(f"{a}{b}".isdecimal() for a, b, _ in spans):  # decimal commas
        cues = [(place, [",".join(fields[:-1]), fields[-1]]) for place, fields in cues]
    chart = chart_of((fields[-1] for _, fields in cues), LETTERS)
    rows = [(cue_time(fields[0], place), shape_of(fields[-1], chart, place)) for place, fields in cues]
    ends_s = [cue_time(fields[-2], place) for place, fields in cues[-1:]]
    return sheet_of(rows, max(ends_s, default=0.0), CUES_FPS)
