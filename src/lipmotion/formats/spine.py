"""``spine.json``: a skeleton of Spine 4 with one slot, ``mouth``, whose attachments, one a shape, an animation changes.

Source: Esoteric Software, "JSON export format" (Spine 4.2). The slot, its attachments and the animation ``speech`` can
be taken into a skeleton of one's own; the pictures are ``A.png`` to ``X.png`` beside the file.
"""

from __future__ import annotations

from typing import Any

from lipmotion.articulation.cue_sheets import CueSheet
from lipmotion.storage.json_text import as_json

VERSION, SLOT, ANIMATION = "4.2.0", "mouth", "speech"
PIXELS = 256
"""Width and height of a mouth until Spine has its picture."""


def skeleton_text(sheet: CueSheet, sound_file: str) -> str:
    """Return the content of the file, in ASCII; the last key is the end, with the shape at rest."""
    shapes = {shape: {"width": PIXELS, "height": PIXELS} for shape in sheet.drawn}
    moved: dict[str, Any] = {
        "slots": {SLOT: {"attachment": [{"time": round(time_s, 2), "name": shape} for time_s, shape in sheet.rows]}}
    }
    document: dict[str, Any] = {
        "skeleton": {"spine": VERSION, "images": "./"},
        "bones": [{"name": "root"}],
        "slots": [{"name": SLOT, "bone": "root", "attachment": sheet.rest}],
        "skins": [{"name": "default", "attachments": {SLOT: shapes}}],
    }
    if sound_file:
        document["events"] = {ANIMATION: {"audio": sound_file}}
        moved["events"] = [{"time": 0, "name": ANIMATION}]
    return as_json({**document, "animations": {ANIMATION: moved}}, indent=1) + "\n"
