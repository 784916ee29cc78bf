"""``json``: metadata and cues, each with start, end and value."""

from __future__ import annotations

import json

from lipmotion.export.cues.sheet import CueSheet


def text(sheet: CueSheet, sound_file: str) -> str:
    """Return the file's text: one line a cue, all of it ASCII."""
    cues = ",\n".join(
        f'    {{ "start": {cue.start_s:.2f}, "end": {cue.end_s:.2f}, "value": "{cue.label}" }}' for cue in sheet.cues
    )
    metadata = f'    "soundFile": {json.dumps(sound_file)},\n    "duration": {sheet.duration_s:.2f}\n'
    return f'{{\n  "metadata": {{\n{metadata}  }},\n  "mouthCues": [\n{cues}\n  ]\n}}\n'
