"""``dat``: switch data of Moho, also read by OpenToonz: frames and Preston Blair's names of the shapes."""

from __future__ import annotations

from lipmotion.errors import InputError
from lipmotion.export.cues.cue_lines import cue_time, shape_of, sheet_of
from lipmotion.export.cues.sheet import CUES_FPS, CueSheet
from lipmotion.units.mouth_chart import BLAIR, LETTERS, SHAPES

MARK = "MohoSwitch1"


def text(sheet: CueSheet, _sound_file: str) -> str:
    """Return the content of the file: the first frame is 1, the last line is the frame after the end, at rest."""
    frames = {1 + int(sheet.fps * cue.start_s): cue.label for cue in reversed(sheet.cues.spans)}
    end = max(1 + int(sheet.fps * sheet.duration_s), max(frames) + 1)
    rows = [*sorted(frames.items()), (end, sheet.rest)]
    return f"{MARK}\n" + "".join(f"{frame} {SHAPES[shape].blair if sheet.blair else shape}\n" for frame, shape in rows)


def parse(text: str) -> CueSheet:
    """Return the cues of a file, whose frames count from 1 and are ``CUES_FPS`` a second: it says no rate.

    Names are Preston Blair's, or letters where one is none of his. Raises InputError: another first line, or a line of
    another form, with its number.
    """
    lines = text.splitlines()
    if not lines or lines[0].strip() != MARK:
        raise InputError(f"not switch data of Moho: the first line is no {MARK}; export it again")
    names = [line.split()[1] for line in lines[1:] if len(line.split()) == 2]
    known = BLAIR if all(name.lower() in BLAIR for name in names) else LETTERS
    rows: list[tuple[float, str]] = []
    for number, line in enumerate(lines[1:], 2):
        fields = line.split()
        if not fields:
            continue
        if len(fields) != 2:
            raise InputError(f"line {number}: required a frame and a mouth shape")
        frame = cue_time(fields[0], f"line {number}")
        rows.append((max(frame - 1, 0) / CUES_FPS, shape_of(fields[1], known, f"line {number}")))
    return sheet_of(rows, rows[-1][0] if rows else 0.0, CUES_FPS)
