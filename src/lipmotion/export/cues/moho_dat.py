"""``dat``: switch data of Moho, also read by OpenToonz: frames and Preston Blair's names of the shapes."""

from __future__ import annotations

from lipmotion.errors import InputError
from lipmotion.export.cues.cue_lines import chart_of, cue_time, shape_of, sheet_of
from lipmotion.export.cues.sheet import CUES_FPS, CueSheet
from lipmotion.units.mouth_chart import SHAPES

MARK = "MohoSwitch1"


def text(sheet: CueSheet, _sound_file: str) -> str:
    """Return the content of the file: the first frame is 1, the last line is the frame after the end, at rest."""
    frames = {1 + int(sheet.fps * cue.start_s): cue.label for cue in reversed(sheet.cues.spans)}
    end = max(1 + int(sheet.fps * sheet.duration_s), max(frames) + 1)
    rows = [*sorted(frames.items()), (end, sheet.rest)]
    return f"{MARK}\n" + "".join(f"{frame} {SHAPES[shape].blair if sheet.blair else shape}\n" for frame, shape in rows)


def parse(text: str, fps: float = CUES_FPS) -> CueSheet:
    """Return the cues of a file, whose frames count from 1; it does not say how many are a second.

    Raises InputError: another first line, or a line of another form, with its number.
    """
    lines = [(number, line.split()) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    if not lines or lines[0][1] != [MARK]:
        raise InputError(f"not switch data of Moho: the first line is no {MARK}; export it again")
    wrong = next((number for number, fields in lines[1:] if len(fields) != 2), None)
    if wrong is not None:
        raise InputError(f"line {wrong}: required a frame and a mouth shape")
    chart = chart_of(name for _, (_, name) in lines[1:])
    rows = [
        (max(cue_time(frame, f"line {number}") - 1, 0) / fps, shape_of(name, chart, f"line {number}"))
        for number, (frame, name) in lines[1:]
    ]
    return sheet_of(rows, rows[-1][0] if rows else 0.0, fps)
