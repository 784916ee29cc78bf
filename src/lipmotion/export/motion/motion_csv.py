"""``.csv``: a table for spreadsheets and scripts: ``time_s`` and one column per channel, without units.

Tables of Live Link Face and of other programs are read as well.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ExportError, InputError, shortened
from lipmotion.export.base import MotionFormat
from lipmotion.export.motion.rounded import formatted_rows
from lipmotion.meshes.files.live_link_table import is_live_link, read_live_link
from lipmotion.meshes.files.steady_rate import exact_rate, steady_rows
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, ARKIT_OTHERS
from lipmotion.types import EYE_DISTANCE, WEIGHT, Channel, Generation, Motion, Timeline, Unit

LONGEST_LINE_CHARACTERS = 1 << 20
"""Most characters of a line."""
LONGEST_S = 1e6
"""Largest time that is accepted: more than eleven days."""
OTHER_TIMES = {"time": 1.0, "t": 1.0, "seconds": 1.0, "timestamp": 1.0, "time_ms": 0.001, "milliseconds": 0.001}
"""Names of a first column that holds the time in tables of other programs, and its unit in seconds. Their times need
not be even, nor begin at 0: the first row is the start."""
LARGEST_WEIGHT = 4.0
"""Largest weight of a blendshape that is read; captures and sculpted faces go a little over 1."""
WEIGHTS = frozenset((*ARKIT_MOUTH, *ARKIT_OTHERS))
"""Channels of these names are blendshapes, whose unit a table need not say."""


def check(motion: Motion) -> None:
    """Raise ExportError if a channel's name would break the header."""
    for name in motion.names:
        if set(name) & set(',;"') or not name.isprintable():
            raise ExportError(f"the channel name {shortened(name)!r} does not fit in a table; write .json or .npz")
    if len(",".join(["time_s", *motion.names])) >= LONGEST_LINE_CHARACTERS:
        raise ExportError(
            f"the channel names do not fit in a line of {LONGEST_LINE_CHARACTERS} letters; write .json or .npz"
        )


def write(path: Path, generation: Generation, _source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write a header and one line per frame."""
    motion = generation.motion
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join(["time_s", *motion.names]) + "\n")
        for time_s, row in zip(motion.time_s.tolist(), formatted_rows(motion.values), strict=True):
            shortest = f"{time_s:.9f}".rstrip("0").rstrip(".")
            file.write(f"{shortest},{row}\n")


def read(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return the motion of a table and an empty timeline.

    Channels with ARKit's names are weights, all others are eye distances. A table of Live Link Face is read as the app
    writes it (``live_link_table``).
    Raises InputError: not a table of numbers with a header, times that are not even, or weights in percent.
    """
    try:
        with path.open(encoding="utf-8-sig") as file:
            head = file.readline(LONGEST_LINE_CHARACTERS).rstrip("\n")
            if is_live_link(head):
                return read_live_link(path)
            first, *names = head.split(",")
            scale = OTHER_TIMES.get(first.strip().lower())
            if (first != "time_s" and scale is None) or not names:
                raise ValueError(f"the first line is {shortened(head)!r}, required 'time_s,opening,...'")
            table = _numbers(file, len(names) + 1)
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"not a table of numbers under a header ({error}); export it again") from error
    if scale is None:
        _check_weights(names, table[:, 1:])
        return Motion(table[:, 1:], _rate(table[:, 0]), tuple(map(_channel, names))), Timeline(())
    if not np.isfinite(table).all():
        raise InputError("there are values that are not finite; interpolate them first")
    _check_weights([name.strip() for name in names], table[:, 1:])
    rows, rate_hz = steady_rows(table[:, 0] * scale, table[:, 1:])
    return Motion(rows, rate_hz, tuple(_channel(name.strip()) for name in names)), Timeline(())


def _check_weights(names: Sequence[str], values: NDArray[np.float64]) -> None:
    """Raise InputError if there are weights far over 1, as in tables for programs that count from 0 to 100."""
    for name, curve in zip(names, values.T, strict=True):
        largest = np.nanmax(curve, initial=0.0)
        if _channel(name).unit == WEIGHT and largest > LARGEST_WEIGHT:
            raise InputError(f"the weight {name} goes up to {largest:g}, required 0 to 1; divide percent by 100")


def _channel(name: str) -> Channel:
    return Channel(name, WEIGHT if name[:1].lower() + name[1:] in WEIGHTS else EYE_DISTANCE)


def _numbers(file: TextIO, columns: int) -> NDArray[np.float64]:
    """Return the rows of a table [shape=(T, columns)]. Raises ValueError: a field is no number, or rows are uneven."""
    numbers = array("d")
    for number, line in enumerate(iter(partial(file.readline, LONGEST_LINE_CHARACTERS), ""), 2):
        row = line.rstrip("\n")
        if row and row.count(",") + 1 != columns:
            raise ValueError(f"line {number} has {row.count(',') + 1} fields, required {columns} numbers in each")
        numbers.extend(map(float, row.split(",") if row else ()))
    return np.frombuffer(numbers, np.float64).reshape(-1, columns) if numbers else np.empty((0, columns))


def _rate(time_s: NDArray[np.float64]) -> float:
    """Return the frame rate in hertz. Raises InputError: too few rows, or times that are not even from 0."""
    if len(time_s) < 2:
        raise InputError("the table has fewer than two rows, so its frame rate is unknown; use .json or .npz")
    if not np.abs(time_s).max() < LONGEST_S:
        raise InputError(f"the column time_s holds values that are no times, required seconds up to {LONGEST_S:.0f}")
    step_s = (time_s[-1] - time_s[0]) / (len(time_s) - 1)
    if time_s[0] != 0 or not step_s > 0 or np.abs(np.diff(time_s) - step_s).max() > 1e-6:
        raise InputError("the column time_s must begin at 0 and rise in even steps")
    return exact_rate(round(float(1 / step_s), 6))


MOTION_FORMAT = MotionFormat(write, read, check)
