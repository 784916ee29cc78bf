"""``json``: metadata and cues, each with start, end and value."""

from __future__ import annotations

import json
from typing import Any

from lipmotion.errors import InputError
from lipmotion.export.cues.cue_lines import cue_time, shape_of, sheet_of
from lipmotion.export.cues.sheet import CUES_FPS, CueSheet
from lipmotion.storage.json_text import as_json
from lipmotion.units.mouth_chart import LETTERS

CUES = "mouthCues"


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
        cues = document[CUES]
    except (ValueError, RecursionError, KeyError, TypeError) as error:
        raise InputError(f"not a file of Rhubarb ({error}); export it again") from error
    rows, end_s = [], 0.0
    for number, cue in enumerate(cues if isinstance(cues, list) else [], 1):
        fields = cue if isinstance(cue, dict) else {}
        place = f"cue {number}"
        rows.append((cue_time(str(fields.get("start")), place), shape_of(str(fields.get("value")), LETTERS, place)))
        end_s = cue_time(str(fields.get("end")), place)
    return sheet_of(rows, end_s, CUES_FPS)
