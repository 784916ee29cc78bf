"""``.csv``: a table for spreadsheets and scripts: ``time_s`` and one column per channel, without units.

Tables of Live Link Face and of other programs are read as well.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lipmotion.errors import ExportError, InputError, shortened
from lipmotion.export.base import MotionFormat
from lipmotion.export.motion.keys import formatted_rows
from lipmotion.meshes.files.curve_table import read_curve_motion
from lipmotion.meshes.files.steady_rate import exact_rate
from lipmotion.meshes.model.shape_names import arkit_name
from lipmotion.storage.text_table import LONGEST_LINE, TextTable, numbers_in, open_table
from lipmotion.types import EYE_DISTANCE, WEIGHT, Channel, Generation, Motion, Timeline, Unit

TIME = "time_s"
"""The first column."""
LONGEST_S = 1e6
"""Largest time that is accepted: more than eleven days."""


def check(motion: Motion) -> None:
    """Raise ExportError if a channel's name would break the header."""
    for name in motion.names:
        if set(name) & set(',;"') or not name.isprintable():
            raise ExportError(f"the channel name {shortened(name)!r} does not fit in a table; write .json or .npz")
    if len(",".join([TIME, *motion.names])) >= LONGEST_LINE:
        raise ExportError(f"the channel names do not fit in a line of {LONGEST_LINE} letters; write .json or .npz")


def write(path: Path, generation: Generation, _source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write a header and one line per frame."""
    motion = generation.motion
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join([TIME, *motion.names]) + "\n")
        for time_s, row in zip(motion.time_s.tolist(), formatted_rows(motion.values), strict=True):
            shortest = f"{time_s:.9f}".rstrip("0").rstrip(".")
            file.write(f"{shortest},{row}\n")


def read(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return the motion of a table and an empty timeline.

    Channels with ARKit's names are weights, all others are eye distances. Tables of other programs are read as
    ``curve_table`` says.
    Raises InputError: not a table of numbers with a header, or times that are not even.
    """
    try:
        with open_table(path) as table:
            if table.names[0] == TIME and len(table.names) > 1:
                return _read(table), Timeline(())
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"not a table of numbers under a header ({error}); export it again") from error
    return read_curve_motion(path)


def _read(table: TextTable) -> Motion:
    """Return the motion of a table as of ``write``. Raises ValueError: a field is no number, or rows are uneven."""
    columns, numbers = len(table.names), array("d")
    for line, fields in table.rows:
        if len(fields) != columns:
            raise ValueError(f"line {line} has {len(fields)} fields, required {columns} numbers in each")
        numbers.extend(numbers_in(fields, line))
    values = np.frombuffer(numbers, np.float64).reshape(-1, columns) if numbers else np.empty((0, columns))
    channels = (Channel(name, WEIGHT if arkit_name(name) else EYE_DISTANCE) for name in table.names[1:])
    time_s = values[:, 0]
    if len(time_s) < 2:
        raise InputError("the table has fewer than two rows, so its frame rate is unknown; use .json or .npz")
    if not np.abs(time_s).max() < LONGEST_S:
        raise InputError(f"the column time_s holds values that are no times, required seconds up to {LONGEST_S:.0f}")
    step_s = (time_s[-1] - time_s[0]) / (len(time_s) - 1)
    if time_s[0] != 0 or not step_s > 0 or np.abs(np.diff(time_s) - step_s).max() > 1e-6:
        raise InputError("the column time_s must begin at 0 and rise in even steps")
    return Motion(values[:, 1:], exact_rate(round(float(1 / step_s), 6)), tuple(channels))


MOTION_FORMAT = MotionFormat(write, read, check)
