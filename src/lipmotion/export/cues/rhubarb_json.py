"""``json``: metadata and cues, each with start, end and value; events of visemes are read alike."""

from __future__ import annotations

import json
from typing import Any

from lipmotion.errors import InputError
from lipmotion.export.cues.cue_lines import chart_of, cue_time, shape_of, sheet_of
from lipmotion.export.cues.sheet import CUES_FPS, CueSheet
from lipmotion.storage.json_text import as_json
from lipmotion.units.mouth_chart import LETTERS

LISTS = ("mouthCues", "visemes", "cues", "events", "keyframes")
STARTS, SHAPES = ("start", "time", "timestamp", "offset", "t"), ("value", "viseme", "shape", "name", "phoneme")
"""Names of lists, and of the start and the shape of an item; the first that is there counts."""


def text(sheet: CueSheet, sound_file: str) -> str:
    """Return the content of the file: one line per cue, in ASCII."""
    cues = ",\n".join(
        f'    {{ "start": {cue.start_s:.2f}, "end": {cue.end_s:.2f}, "value": "{cue.label}" }}' for cue in sheet.cues
    )
    metadata = f'    "soundFile": {as_json(sound_file)},\n    "duration": {sheet.duration_s:.2f}\n'
    return f'{{\n  "metadata": {{\n{metadata}  }},\n  "mouthCues": [\n{cues}\n  ]\n}}\n'


def parse(text: str) -> CueSheet:
    """Return the cues of a file. Raises InputError: it is no JSON, or a cue is none, with its number."""
    try:
        document: Any = json.loads(text)
        cues = document if isinstance(document, list) else next(document[name] for name in LISTS if name in document)
    except (ValueError, RecursionError, StopIteration, TypeError) as error:
        raise InputError(f"not a file of Rhubarb ({error or 'no mouthCues'}); export it again") from error
    found: list[tuple[str, str, str, str]] = []
    for number, cue in enumerate(cues if isinstance(cues, list) else [], 1):
        fields = cue if isinstance(cue, dict) else {}
        start, shape = (next((str(fields[n]) for n in names if n in fields), "None") for names in (STARTS, SHAPES))
        found.append((f"cue {number}", start, str(fields.get("end", start)), shape))
    chart = chart_of((shape for *_, shape in found), LETTERS)
    rows = [(cue_time(start, place), shape_of(shape, chart, place)) for place, start, _, shape in found]
    return sheet_of(rows, max((cue_time(end, place) for place, _, end, _ in found[-1:]), default=0.0), CUES_FPS)
