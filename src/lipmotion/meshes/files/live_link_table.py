"""Tables of curves as the app Live Link Face records them: a timecode, a count, and 61 curves of ARKit.

Source: files of the app. ``HH:MM:SS:FF.mmm``: FF frames of the timecode's rate, and thousandths of a frame.
"""

from __future__ import annotations

import re
from array import array
from functools import partial
from pathlib import Path
from typing import NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shortened
from lipmotion.meshes.files.steady_rate import steady_rows
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, arkit_name
from lipmotion.types import WEIGHT, Channel, Motion, Timeline, Unit
from lipmotion.types.motion import RADIAN

Array = NDArray[np.float64]

FIRST, COUNT = "timecode", "blendshapecount"
"""Names of the first two columns; capitals do not matter, for versions of the app differ."""
ANGLES = ("Yaw", "Pitch", "Roll")
"""Endings of the curves that are angles of the head and of the eyes."""
SPEECH_CURVES = frozenset(
    (*ARKIT_MOUTH, "cheekPuff", "cheekSquintLeft", "cheekSquintRight", "noseSneerLeft", "noseSneerRight")
)
"""The curves that speech moves: those of mouth, jaw, tongue, cheeks and nose."""
TIMECODE_RATES = (24, 25, 30, 48, 50, 60, 120)
APP_RATE = 60
"""Frames a second of the timecode where a take does not show it: what the app has by default."""
DAY_S = 86_400.0
BACKWARDS_S = 0.5
"""A row whose time is earlier than that of the row before by less than this is left out; more is an error."""
LONGEST_LINE = 1 << 16
MOST_CURVES = 2000
_TIMECODE = re.compile(r"(\d{1,2}):(\d{1,2}):(\d{1,2})([:;.])(\d{1,3}(?:\.\d{1,9})?|\d{1,9})", re.ASCII)


class Timecode(NamedTuple):
    """One timecode: whole seconds since midnight, frames (fractions included), and what stands before the frames.

    mark : ``:``, ``;`` (drop-frame), or ``.`` where not frames but parts of a second follow
    """

    seconds: int
    frames: float
    mark: str


def is_live_link(head: str) -> bool:
    """Return whether the first line of a table is that of Live Link Face."""
    names = [name.strip().strip('"').lower() for name in head.split(",", 2)[:2]]
    return names[:1] == [FIRST] and (len(names) < 2 or names[1] == COUNT or arkit_name(names[1]) is not None)


def is_live_link_file(path: Path) -> bool:
    """Return whether a file is such a table; a file that cannot be read is none."""
    try:
        with path.open(encoding="utf-8-sig") as file:
            return is_live_link(file.readline(LONGEST_LINE))
    except (OSError, ValueError):
        return False


def speech_curves(motion: Motion) -> Motion:
    """Return the curves that speech moves, without those of eyes, brows and head. Raises InputError: there are none."""
    columns = [column for column, name in enumerate(motion.names) if name in SPEECH_CURVES]
    if not columns:
        raise InputError("none of its curves is one of mouth or jaw, required jawOpen, mouthClose, ...")
    return Motion(motion.values[:, columns], motion.rate_hz, tuple(motion.channels[column] for column in columns))


def read_live_link(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return the curves of a table by ARKit's names, at a steady rate from its first row on, and an empty timeline.

    Rows without a face (a count of 0, or empty fields) are bridged. Angles have the unit ``radian``, all others are
    weights. Frames that the app lost and uneven times are evened out (``steady_rate.steady_rows``).
    Raises InputError: not such a table, a field that is no number, timecodes that go back, or gaps without end.
    """
    try:
        with path.open(encoding="utf-8-sig") as file:
            names, skipped = _names(file.readline(LONGEST_LINE))
            codes, values = _rows(file, len(names), skipped)
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"not a table of Live Link Face ({error}); export the take again") from error
    times_s = _seconds(codes)
    kept = _in_order(times_s) & np.isfinite(values).all(axis=1)
    rows, rate_hz = steady_rows(times_s[kept], values[kept])
    return Motion(rows, rate_hz, tuple(map(_channel, names))), Timeline(())


def _names(head: str) -> tuple[list[str], int]:
    """Return the names of the curves, and how many columns stand before them."""
    fields = [field.strip().strip('"') for field in head.strip().rstrip(",").split(",")]
    skipped = 2 if len(fields) > 1 and fields[1].lower() == COUNT else 1
    names = fields[skipped:]
    if fields[0].lower() != FIRST or not 0 < len(names) <= MOST_CURVES:
        raise ValueError(
            f"the first line is {shortened(head.strip())!r}, required Timecode,BlendshapeCount,JawOpen,..."
        )
    return names, skipped


def _channel(name: str) -> Channel:
    if name.endswith(ANGLES):
        return Channel(name[:1].lower() + name[1:], RADIAN)
    return Channel(arkit_name(name) or name, WEIGHT)


def _rows(file: TextIO, curves: int, skipped: int) -> tuple[list[Timecode], Array]:
    """Return timecodes and values [shape=(N, curves)]; rows without a face hold NaN."""
    codes: list[Timecode] = []
    numbers = array("d")
    nothing = array("d", [float("nan")]) * curves
    for number, line in enumerate(iter(partial(file.readline, LONGEST_LINE), ""), 2):
        fields = line.strip().split(",")
        if fields == [""]:
            continue
        codes.append(_timecode(fields[0].strip().strip('"'), number))
        found = fields[skipped:]
        while len(found) > curves and not found[-1].strip():
            found.pop()
        if (skipped == 2 and fields[1:2] == ["0"]) or not any(field.strip() for field in found):
            numbers.extend(nothing)
            continue
        if len(found) != curves:
            raise ValueError(f"line {number} has {len(found)} curves, required {curves}; delete it if it is the last")
        numbers.extend(map(float, found))
    if not codes:
        raise ValueError("there are no rows")
    return codes, np.frombuffer(numbers, np.float64).reshape(-1, curves)


def _timecode(text: str, line: int) -> Timecode:
    found = _TIMECODE.fullmatch(text)
    if found is None or int(found[2]) > 59 or int(found[3]) > 59:
        raise ValueError(f"line {line} begins with {shortened(text)!r}, required a timecode as 12:30:59:29.500")
    seconds = (int(found[1]) * 60 + int(found[2])) * 60 + int(found[3])
    if found[4] == ".":
        return Timecode(seconds, float(f"0.{found[5].replace('.', '')}"), ".")
    return Timecode(seconds, float(found[5]), found[4])


def _seconds(codes: list[Timecode]) -> Array:
    """Return timecodes as seconds since the midnight before the first [shape=(N,)]."""
    whole = np.array([code.seconds for code in codes], float)
    frames = np.array([code.frames for code in codes])
    if codes[0].mark == ".":
        times_s = whole + frames
    else:
        rate = _timecode_rate(whole, frames)
        times_s = whole + frames / rate
        if codes[0].mark == ";":  # numbers 0 and 1 are dropped in every minute but each tenth (SMPTE 12M)
            minutes = np.floor(whole / 60)
            dropped = rate / 15 * (minutes - np.floor(minutes / 10))
            times_s = (whole * rate + frames - dropped) * 1001 / (1000 * rate)
    over = np.concatenate([[0.0], np.cumsum(np.diff(times_s) < -DAY_S / 2)])
    return times_s + DAY_S * over


def _timecode_rate(whole: Array, frames: Array) -> int:
    """Return how many frames of the timecode make a second."""
    passed = np.flatnonzero(np.diff(whole) == 1)
    most = int(frames.max() if len(passed) > 1 else frames[passed].max() if len(passed) else frames.max())
    if most >= TIMECODE_RATES[-1]:
        raise InputError(f"a timecode has frame {most}, required less than {TIMECODE_RATES[-1]}")
    shown = next(rate for rate in TIMECODE_RATES if rate > most)
    return shown if len(passed) else max(shown, APP_RATE)


def _in_order(times_s: Array) -> NDArray[np.bool_]:
    """Return which rows are later than all before them. Raises InputError: a row goes far back."""
    latest = np.maximum.accumulate(times_s)
    back = latest - times_s
    if back.max() > BACKWARDS_S:
        row = int(np.argmax(back > BACKWARDS_S)) + 2
        raise InputError(f"the timecode of line {row} goes back by {back[row - 2]:.2f} s, required: one take in order")
    return np.concatenate([[True], times_s[1:] > latest[:-1]])
