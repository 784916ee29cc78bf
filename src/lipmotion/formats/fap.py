"""``.fap``: MPEG-4 facial animation parameters of lips and jaw, as text.

Source: ISO/IEC 14496-2, Annex C, and the files of its reference software: a line ``2.1 NAME FPS FRAMES``; for each
frame a line of 68 marks, which parameters follow, and a line with the number of the frame and their values. The
parameters 1 (viseme) and 2 (expression) have four and six values; they are passed over, and never written.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.lip_points import build_mouth
from lipmotion.errors import ExportError, InputError, shorten
from lipmotion.formats.base import MotionFormat
from lipmotion.formats.steady_rate import exact_rate
from lipmotion.meshes.fitting.blendshape_motion import move_points
from lipmotion.storage.sources import read_shipped_table
from lipmotion.types import Channel, Generation, Motion, Timeline, Unit

FAP = "fap"  # the unit of these channels: whole steps of a 1024th of a distance in the face, of either sign
STEPS = 1024.0
MOUTH_TO_NOSE = 0.30
"""The distance from the nose to where the lips meet (MNS0) in a mean face, in eye distances; the width of the mouth
(MW0) is the template's."""
PARAMETERS = tuple(
    (int(row["number"]), row["name"], int(row["point"]), int(row["axis"]), int(row["sign"]), row["unit"])
    for row in read_shipped_table("lipmotion.formats", "fap.csv")
)
"""The parameters of lips and jaw that points show, left and right the speaker's own: number, name, point, axis (x left,
y up, z out), sign, unit (N: mouth to nose, W: width of the mouth)."""
VERSION = "2.1"
COUNT = 68
MANY_VALUES = {1: 4, 2: 6}  # how many values the first two parameters have
NAMES = {number: f"fap{number}_{name}" for number, name, *_ in PARAMETERS}
LARGEST_VALUE = 1_000_000
LONGEST_LINE = 1 << 14
MAX_FRAMES = 10_000_000


def check(motion: Motion) -> None:
    """Raise ExportError if motion holds anything but these parameters."""
    others = [name for name in motion.names if _number(name) is None]
    if others or not motion.names:
        raise ExportError(f"no parameters of MPEG-4 but {shorten(', '.join(others[:4])) or 'nothing'}; write .json")
    if len({_number(name) for name in motion.names}) < len(motion.names):
        raise ExportError("two channels are the same parameter of MPEG-4, required each once; write .json")


def write(path: Path, generation: Generation, source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write the parameters of every frame, rounded to whole numbers."""
    motion = generation.motion
    columns = sorted(range(len(motion.names)), key=lambda column: _number(motion.names[column]) or 0)
    numbers = [_number(motion.names[column]) for column in columns]
    mask = " ".join("1" if number in numbers else "0" for number in range(1, COUNT + 1))
    name = "".join(letter if letter.isalnum() else "_" for letter in Path(source.get("file", "lipmotion")).stem)
    with path.open("w", encoding="ascii", errors="replace", newline="\n") as file:
        file.write(f"{VERSION} {name or 'lipmotion'} {motion.rate_hz:.9g} {len(motion.values)}\n")
        for frame, row in enumerate(np.rint(motion.values[:, columns]).astype(int).tolist()):
            file.write(f"{mask}\n{frame} {' '.join(map(str, row))}\n")


def read(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return the parameters of a file; one that is not given keeps its value. Raises InputError: not such a file."""
    with path.open(encoding="utf-8-sig") as file:
        lines = (line for line in iter(partial(file.readline, LONGEST_LINE), "") if line[0] != "#" and line.strip())
        head = next(lines, "").split()
        if len(head) < 4 or not head[0].startswith("2."):
            raise InputError(f"it begins with {shorten(' '.join(head))!r}, required {VERSION} NAME FPS FRAMES")
        rate, frames = head[-2], int(head[-1])
        rows: list[NDArray[np.int32]] = []
        current, used = np.zeros(COUNT, np.int32), np.zeros(COUNT, bool)
        if not 0 < frames <= MAX_FRAMES:
            raise InputError(f"{frames} frames, required 1 to {MAX_FRAMES}")
        for frame in range(frames):
            marks, values = next(lines, "").split(), next(lines, "").split()[1:]
            if len(marks) != COUNT or set(marks) - {"0", "1"}:
                raise InputError(f"frame {frame} of {frames} has {len(marks)} marks, required {COUNT} of 0 or 1")
            marked = [number for number, mark in enumerate(marks, 1) if mark == "1"]
            needed = sum(MANY_VALUES.get(number, 1) for number in marked)
            if len(values) != needed:
                raise InputError(f"frame {frame} of {frames} has {len(values)} values, required {needed}")
            skipped = sum(MANY_VALUES[number] for number in marked if number in MANY_VALUES)
            present = [int(value) for value in values[skipped:]]
            if max(map(abs, present), default=0) > LARGEST_VALUE:
                raise InputError(f"frame {frame} has a value over {LARGEST_VALUE}")
            current = current.copy()
            places = [number - 1 for number in marked if number not in MANY_VALUES]
            current[places], used[places] = present, True
            rows.append(current)
    numbers = np.flatnonzero(used) + 1
    channels = tuple(Channel(NAMES.get(int(number), f"fap{number}"), FAP) for number in numbers)
    return Motion(np.stack(rows)[:, numbers - 1].astype(np.float64), exact_rate(float(rate)), channels), Timeline(())


def _number(name: str) -> int | None:
    digits = name.removeprefix("fap").partition("_")[0]
    is_number = name.startswith("fap") and digits.isascii() and digits.isdecimal()
    return int(digits) if is_number and len(MANY_VALUES) < int(digits) <= COUNT else None


def move_faps(motion: Motion, units: Timeline[Unit]) -> Motion:
    """Return the parameters over time: channels ``fap3_open_jaw``, ..., whole numbers; the rest pose is 0.

    Where the lips touch, ``lower_t_midlip`` and ``raise_b_midlip`` add up to 0.
    Raises InputError: as ``move_points``.
    """
    shifts, template = move_points(motion, units).expressed, build_mouth()
    lengths = {"N": MOUTH_TO_NOSE, "W": template.width}
    columns = [
        np.rint(sign * shifts[:, template.row(point), axis] / lengths[unit] * STEPS)
        for _, _, point, axis, sign, unit in PARAMETERS
    ]
    return Motion(np.stack(columns, axis=1), motion.rate_hz, tuple(Channel(name, FAP) for name in NAMES.values()))


MOTION_FORMAT = MotionFormat(write, read, check, curves="fap")
