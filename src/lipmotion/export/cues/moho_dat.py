"""``dat``: switch data of Moho, also read by OpenToonz: frames and Preston Blair's names of the shapes."""

from __future__ import annotations

from lipmotion.export.cues.cue_shapes import SHAPES
from lipmotion.export.cues.sheet import CueSheet


def text(sheet: CueSheet, _sound_file: str) -> str:
    """Return the content of the file: the first frame is 1, the last line is the frame after the end, at rest."""
    frames = {1 + int(sheet.fps * cue.start_s): cue.label for cue in reversed(sheet.cues.spans)}
    end = max(1 + int(sheet.fps * sheet.duration_s), max(frames) + 1)
    rows = [*sorted(frames.items()), (end, sheet.rest)]
    return "MohoSwitch1\n" + "".join(f"{frame} {SHAPES[shape].blair}\n" for frame, shape in rows)
