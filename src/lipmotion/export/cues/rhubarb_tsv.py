"""``tsv``: one line per cue with its start and its shape; the last line is the end, with the shape at rest."""

from __future__ import annotations

from lipmotion.errors import InputError
from lipmotion.export.cues.cue_lines import cue_time, shape_of, sheet_of
from lipmotion.export.cues.sheet import CUES_FPS, CueSheet
from lipmotion.units.mouth_chart import LETTERS


def text(sheet: CueSheet, _sound_file: str) -> str:
    """Return the content of the file."""
    rows = [(cue.start_s, cue.label) for cue in sheet.cues]
    return "".join(f"{time_s:.2f}\t{shape}\n" for time_s, shape in [*rows, (sheet.duration_s, sheet.rest)])


def parse(text: str) -> CueSheet:
    """Return the cues of a file. Raises InputError: a line of another form, with its number."""
    rows: list[tuple[float, str]] = []
    for number, line in enumerate(text.splitlines(), 1):
        fields = line.split("\t")
        if not line.strip():
            continue
        if len(fields) != 2:
            raise InputError(f"line {number}: required a time, a tab and a mouth shape")
        rows.append((cue_time(fields[0], f"line {number}"), shape_of(fields[1], LETTERS, f"line {number}")))
    return sheet_of(rows, rows[-1][0] if rows else 0.0, CUES_FPS)
