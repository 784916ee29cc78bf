"""``tsv``: one line per cue with its start and its shape; the last line is the end, with the shape at rest."""

from __future__ import annotations

from lipmotion.export.cues.sheet import CueSheet


def text(sheet: CueSheet, _sound_file: str) -> str:
    """Return the content of the file."""
    rows = [(cue.start_s, cue.label) for cue in sheet.cues]
    return "".join(f"{time_s:.2f}\t{shape}\n" for time_s, shape in [*rows, (sheet.duration_s, sheet.rest)])
