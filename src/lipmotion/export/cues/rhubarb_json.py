"""``json``: metadata and cues, each with start, end and value."""

from __future__ import annotations

from lipmotion.export.cues.sheet import CueSheet
from lipmotion.storage.json_text import as_json


def text(sheet: CueSheet, sound_file: str) -> str:
    """Return the content of the file: one line per cue, in ASCII."""
    cues = ",\n".join(
        f'    {{ "start": {cue.start_s:.2f}, "end": {cue.end_s:.2f}, "value": "{cue.label}" }}' for cue in sheet.cues
    )
    metadata = f'    "soundFile": {as_json(sound_file)},\n    "duration": {sheet.duration_s:.2f}\n'
    return f'{{\n  "metadata": {{\n{metadata}  }},\n  "mouthCues": [\n{cues}\n  ]\n}}\n'
