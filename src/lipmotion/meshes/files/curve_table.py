"""Tables of curves over time, as apps of capture and other programs write them.

Read are takes of Live Link Face (``Timecode,BlendshapeCount,JawOpen,…``), Audio2Face-3D's ``animation_frames.csv``
(``,timeCode,blendShapes.JawOpen,…``), scripts around MediaPipe (``frame,timestamp_ms,_neutral,browDownLeft,…``, or one
blendshape a row with its score), and any other with a column of times. Source: files of these programs.
A timecode is ``HH:MM:SS:FF.mmm``: FF frames of the timecode's rate, and thousandths of a frame.
"""

from __future__ import annotations

import logging
import re
from array import array
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shortened
from lipmotion.meshes.files.steady_rate import steady_rows
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, arkit_name, is_known
from lipmotion.motion.rest import runs
from lipmotion.storage.text_table import numbers_in, open_table
from lipmotion.types import EYE_DISTANCE, WEIGHT, Channel, Motion, Timeline, Unit
from lipmotion.types.motion import RADIAN

Array = NDArray[np.float64]
LOG = logging.getLogger("lipmotion")

FIRST, COUNT = "timecode", "blendshapecount"
"""Names of the first two columns of the app; capitals do not matter, for versions of the app differ."""
ANGLES = ("Yaw", "Pitch", "Roll")
"""Endings of the curves that are angles of the head and of the eyes."""
SPEECH_CURVES = frozenset(
    (*ARKIT_MOUTH, "cheekPuff", "cheekSquintLeft", "cheekSquintRight", "noseSneerLeft", "noseSneerRight")
)
"""The curves that speech moves: those of mouth, jaw, tongue, cheeks and nose."""
PER_SECOND = {"ms": 1e3, "msec": 1e3, "milliseconds": 1e3, "us": 1e6, "microseconds": 1e6, "ns": 1e9}
TIME_COLUMN = re.compile(
    rf"(?:(?:time(?:stamp|code)?|t)(?:s|secs?|seconds?|{'|'.join(PER_SECOND)})?|seconds?|milliseconds)"
)
"""Names of columns of times, without blanks, brackets and underscores."""
NO_CURVES = re.compile(r"(?:|unnamed:?0|(?:frame|face)?(?:index|idx|id|number|no|num)?s?|blendshapecount|neutral)")
"""The same of columns that are no curves: numbers of frames and faces, and what MediaPipe calls neutral."""
SCORES = ("score", "value", "weight", "coefficient")
TIMECODE_RATES = (24, 25, 30, 48, 50, 60, 120)
APP_RATE = 60
"""Frames a second of the timecode where a take does not show it: what the app has by default."""
DAY_S = 86_400.0
BACKWARDS_S = 0.5
"""A row whose time is earlier than that of the row before by less than this is left out; more is an error."""
LEFT_OUT_SHARE, LEFT_OUT = 0.1, 3
"""So many rows may be left out: a share of all, or a few."""
LONGEST_STEP_S = 2.0
"""Rows that are further apart are not seconds apart: the column of times has another unit."""
MISREAD_ROWS = 10
"""More rows a second apart are frames, of which a spreadsheet made seconds."""
MOST_CURVES = 2000
_TIMECODE = re.compile(r"(\d{1,2})[:;](\d{1,2})[:;](\d{1,2})(?:([:;.,])(\d{1,9}(?:[.,]\d{1,9})?))?", re.ASCII)


class Timecode(NamedTuple):
    """One timecode: whole seconds since midnight, frames (fractions included), and what stands before the frames.

    mark : ``:``, ``;`` (drop-frame), ``.`` where not frames but parts of a second follow, or empty: nothing follows
    """

    seconds: int
    frames: float
    mark: str


def is_live_link(names: Sequence[str]) -> bool:
    """Return whether the columns of a table are those of Live Link Face."""
    lower = [name.lower() for name in names[:2]]
    return lower[:1] == [FIRST] and (lower[1:] in ([], [COUNT]) or (is_known(names[1]) and "." not in names[1]))


def is_live_link_file(path: Path) -> bool:
    """Return whether a file is such a table; a file that cannot be read is none."""
    try:
        with open_table(path) as table:
            return is_live_link(table.plain_names)
    except (OSError, ValueError):
        return False


def speech_curves(motion: Motion) -> Motion:
    """Return the curves that speech moves, without those of eyes, brows and head. Raises InputError: there are none."""
    columns = [column for column, name in enumerate(motion.names) if name in SPEECH_CURVES]
    if not columns:
        raise InputError("none of its curves is one of mouth or jaw, required jawOpen, mouthClose, ...")
    return Motion(motion.values[:, columns], motion.rate_hz, tuple(motion.channels[column] for column in columns))


def read_curve_motion(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return the curves of a table as of ``read_curve_table``, and an empty timeline."""
    return read_curve_table(path)[0], Timeline(())


def read_curve_table(path: Path) -> tuple[Motion, NDArray[np.bool_]]:
    """Return the curves of a table at a steady rate from its first row on, and in which frames a face was seen.

    Names that are understood become ARKit's. Angles have the unit ``radian``; all others are weights in a take of Live
    Link Face, and else eye distances where they are no blendshapes. What is done with rows without a face, and with
    times that are not even, ``motion_at_times`` says.
    Raises InputError: not such a table, a field that is no number, times that go back, or gaps without end.
    """
    try:
        with open_table(path) as table:
            names = table.plain_names
            keys = list(map(column_key, names))
            timed = next((column for column, key in enumerate(keys) if TIME_COLUMN.fullmatch(key)), None)
            used = [n for n, key in enumerate(keys) if n != timed and not NO_CURVES.fullmatch(key)]
            if timed is None or not 0 < len(used) <= MOST_CURVES:
                raise ValueError(
                    f"the first line is {shortened(','.join(names))!r}, required 'time_s,opening,...', or curves "
                    "beside a column of times: Timecode,BlendshapeCount,JawOpen,... or timestamp_ms,jawOpen,..."
                )
            times, names, values = _rows(table.rows, names, timed, used, keys.index(COUNT) if COUNT in keys else None)
            coded = bool(re.search("[:;]", times[0][1]))
            if coded:
                time_s = _seconds([_timecode(text, line) for line, text in times])
            else:
                time_s = in_seconds(np.array([numbers_in([text], line)[0] for line, text in times]), keys[timed])
            return motion_at_times(names, time_s, values, WEIGHT if coded else EYE_DISTANCE)
    except (ValueError, OverflowError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"not a table of numbers under a header ({error}); export it again") from error


def column_key(name: str) -> str:
    """Return the name of a column as it is compared: ``Time (ms)`` is ``timems``."""
    return re.sub(r"[\s_()\[\].-]+", "", name).lower()


def _rows(
    rows: Iterator[tuple[int, list[str]]], names: list[str], timed: int, used: list[int], counted: int | None
) -> tuple[list[tuple[int, str]], list[str], Array]:
    """Return the lines and times of the rows, and names and values of curves [shape=(N, P)]: NaN without a face."""
    times: list[tuple[int, str]] = []
    faces: list[int] = []
    numbers = array("d")
    columns = len(names)
    for line, fields in rows:
        while len(fields) > columns and not fields[-1].strip():
            fields.pop()
        times.append((line, fields[timed].strip() if timed < len(fields) else ""))
        found = [fields[column] for column in used if column < len(fields)]
        if not any(map(str.strip, found)) or (counted is not None and fields[counted : counted + 1] in (["0"], [" 0"])):
            continue
        if len(fields) != columns:
            curves = len(fields) - columns + len(used)
            raise ValueError(f"line {line} has {curves} curves, required {len(used)}; delete it if it is the last")
        if not faces:
            texts = [column for column in used if _is_text(fields[column], names[column])]
            used = [column for column in used if column not in texts]
            if not used:
                raise ValueError(f"line {line} has no numbers beside the time")
            of_names = [c for c in texts if is_known(fields[c].strip()) or fields[c].strip() == "_neutral"]
            if of_names:
                return _of_single_scores(chain([(line, fields)], rows), names, timed, of_names[0], used)
            if texts:
                named = ", ".join(shortened(names[column]) for column in texts)
                LOG.warning("%d columns hold text, not numbers, and are left out: %s", len(texts), named)
                found = [fields[column] for column in used]
        faces.append(len(times) - 1)
        numbers.extend(numbers_in(found, line))
    if not times:
        raise ValueError("there are no rows")
    values = np.full((len(times), len(used)), np.nan)
    values[faces] = np.frombuffer(numbers, np.float64).reshape(len(faces), len(used)) if numbers else np.nan
    return times, [names[column] for column in used], values


def _is_text(field: str, name: str) -> bool:
    """Return whether a field is no number, in a column whose name does not promise one."""
    try:
        numbers_in([field], 0)
    except ValueError:
        return not is_known(name)
    return False


def _of_single_scores(
    rows: chain[tuple[int, list[str]]], names: list[str], timed: int, named: int, used: list[int]
) -> tuple[list[tuple[int, str]], list[str], Array]:
    """Return what ``_rows`` does of a table with one blendshape a row: its name in one column, its score in another."""
    score = next((column for column in used if names[column].strip().lower() in SCORES), used[-1])
    frames: dict[str, dict[str, float]] = {}
    lines: dict[str, int] = {}
    for line, fields in rows:
        if len(fields) <= max(timed, named, score):
            raise ValueError(f"line {line} has {len(fields)} fields, required {len(names)}")
        time = fields[timed].strip()
        lines.setdefault(time, line)
        frames.setdefault(time, {})[fields[named].strip()] = numbers_in([fields[score]], line)[0]
    known, values = tabulated(list(frames.values()))
    return [(line, time) for time, line in lines.items()], known, values


def tabulated(frames: Sequence[Mapping[str, float]]) -> tuple[list[str], Array]:
    """Return the names of all curves of some frames, and their values [shape=(N, P)]; NaN where a frame has none."""
    names = [name for name in dict.fromkeys(name for frame in frames for name in frame) if name != "_neutral"]
    return names, np.array([[frame.get(name, np.nan) for name in names] for frame in frames], float)


def in_seconds(times: Array, key: str) -> Array:
    """Return times in seconds; their size shows the unit where the name of their column (``column_key``) does not.

    Raises InputError: one is no number.
    """
    if not np.isfinite(times).all():
        raise InputError(f"the time of row {int(np.argmin(np.isfinite(times))) + 1} is no number, required one in each")
    per_second = next((scale for unit, scale in PER_SECOND.items() if key.endswith(unit)), 1.0)
    step = float(np.median(np.diff(times))) / per_second if len(times) > 1 else 0.0
    if per_second == 1 and step > LONGEST_STEP_S:
        per_second = next(scale for scale in (1e3, 1e6, 1e9) if step / scale <= LONGEST_STEP_S or scale == 1e9)
        LOG.warning("the times rise by %g a row: read as parts of a second, %g of them", step, per_second)
    return np.asarray(times / per_second)


def motion_at_times(
    names: Sequence[str], time_s: Array, values: Array, unit: str = WEIGHT
) -> tuple[Motion, NDArray[np.bool_]]:
    """Return curves at a steady rate from the first time on, and in which frames they were measured.

    time_s : of the rows, in seconds [shape=(N,)];  values : NaN where there is no face [shape=(N, P)]
    unit   : of curves that are neither blendshapes nor angles
    Before the first face and after the last one weights are 0 and other curves still; between faces is a straight line.
    Rows that are not later than all before are left out, frames that were lost and uneven times evened out
    (``steady_rows``). A warning says how many rows each of this was.
    Raises InputError: a row goes far back, too many are left out, no rows, or most of the time has none.
    """
    ordered = _in_order(time_s)
    time_s, values = time_s[ordered], values[ordered]
    measured: NDArray[np.bool_] = np.asarray(np.isfinite(values).any(axis=0))
    if not measured.any():
        raise InputError("0 rows with values, required two or more")
    if not measured.all():
        empty = ", ".join(name for name, there in zip(names, measured, strict=True) if not there)
        LOG.warning("columns without any number are left out: %s", shortened(empty))
    names = [name for name, there in zip(names, measured, strict=True) if there]
    values = values[:, measured]
    channels = [_channel(name, unit) for name in names]
    kept = strongest_columns([channel.name for channel in channels], values)
    values, channels = values[:, kept], [channels[column] for column in kept]
    seen: NDArray[np.bool_] = np.asarray(np.isfinite(values).all(axis=1))
    if not seen.all():
        if not seen.any():
            raise InputError("0 rows with values of all curves, required two or more")
        _bridge(time_s, values, seen, np.array([channel.unit == WEIGHT for channel in channels]))
    rows, rate_hz = steady_rows(time_s, np.concatenate([values, seen[:, None]], axis=1))
    return Motion(rows[:, :-1], rate_hz, tuple(channels)), rows[:, -1] > 0.5


def _channel(name: str, unit: str) -> Channel:
    if name.endswith(ANGLES):
        return Channel(name[:1].lower() + name[1:], RADIAN)
    return Channel(arkit_name(name) or name, WEIGHT if is_known(name) else unit)


def strongest_columns(names: Sequence[str], values: Array) -> list[int]:
    """Return one column of each name, in order: where several have it, the one that moves most, with a warning."""
    if len(set(names)) == len(names):
        return list(range(len(names)))
    with np.errstate(invalid="ignore"):
        moved = np.nanmax(values, axis=0, initial=-np.inf) - np.nanmin(values, axis=0, initial=np.inf)
    best: dict[str, int] = {}
    for column, name in enumerate(names):
        if name not in best or moved[column] > moved[best[name]]:
            best[name] = column
    twice = [name for name in best if sum(moved[c] > 0 for c, other in enumerate(names) if other == name) > 1]
    if twice:
        LOG.warning("%d curves are there more than once: the one that moves most counts: %s", len(twice), twice[:8])
    return sorted(best.values())


def _bridge(time_s: Array, values: Array, seen: NDArray[np.bool_], weights: NDArray[np.bool_]) -> None:
    """Fill rows without a face: straight lines between faces, rest before the first and after the last one."""
    spans = [f"{time_s[first] - time_s[0]:.2f}–{time_s[last - 1] - time_s[0]:.2f} s" for first, last in runs(~seen)]
    more = f" and {len(spans) - 4} more" if len(spans) > 4 else ""
    LOG.warning(
        "%d of %d rows have no face or lack numbers, at %s%s: straight lines between, at rest before and after",
        *(int((~seen).sum()), len(seen), ", ".join(spans[:4]), more),
    )
    for column in range(values.shape[1]):
        values[:, column] = np.interp(time_s, time_s[seen], values[seen, column])
    first, last = np.flatnonzero(seen)[[0, -1]]
    values[np.ix_((np.arange(len(seen)) < first) | (np.arange(len(seen)) > last), weights)] = 0.0


def _timecode(text: str, line: int) -> Timecode:
    found = _TIMECODE.fullmatch(text)
    if found is None or int(found[2]) > 59 or int(found[3]) > 59:
        raise ValueError(
            f"line {line} begins with {shortened(text)!r}, required a timecode as 12:30:59:29.500; spreadsheets "
            "shorten it: take the file as it was recorded"
        )
    seconds = (int(found[1]) * 60 + int(found[2])) * 60 + int(found[3])
    if found[4] is None:
        return Timecode(seconds, 0.0, "")
    if found[4] in ".,":
        return Timecode(seconds, float("0." + re.sub("[.,]", "", found[5])), ".")
    return Timecode(seconds, float(found[5].replace(",", ".")), found[4])


def _seconds(codes: list[Timecode]) -> Array:
    """Return timecodes as seconds since the midnight before the first [shape=(N,)]."""
    whole = np.array([code.seconds for code in codes], float)
    frames = np.array([code.frames for code in codes])
    day_s, mark = DAY_S, codes[0].mark
    if mark == "." and len(codes) > MISREAD_ROWS and (frames == frames[0]).all():
        mark = ""
    if not mark and len(codes) > MISREAD_ROWS and np.median(np.diff(whole)) == 1:
        LOG.warning("rows are a second apart: the last field of the timecodes is taken for frames (MM:SS:FF)")
        whole, frames, mark = whole // 60, whole % 60, ":"
    if not mark:
        starts = np.flatnonzero(np.diff(whole)) + 1
        if len(starts) < 2:
            raise ValueError(
                "the timecodes have no frames (HH:MM:SS), required HH:MM:SS:FF: a spreadsheet has shortened them"
            )
        rate = (starts[-1] - starts[0]) / ((whole[starts[-1]] - whole[starts[0]]) % DAY_S)
        LOG.warning("the timecodes have no frames: %d rows are taken as even, %.2f a second", len(whole), rate)
        return np.asarray(np.arange(len(whole)) / rate)
    if mark == ".":
        time_s = whole + frames
    else:
        passed = np.flatnonzero(np.diff(whole) == 1)
        most = int(frames.max() if len(passed) > 1 else frames[passed].max() if len(passed) else frames.max())
        if most >= TIMECODE_RATES[-1]:
            raise InputError(f"a timecode has frame {most}, required less than {TIMECODE_RATES[-1]}")
        shown = next(rate for rate in TIMECODE_RATES if rate > most)
        rate = shown if len(passed) else max(shown, APP_RATE)
        time_s = whole + frames / rate
        if mark == ";" or _drops_frames(whole, frames, rate):
            time_s, day_s = _dropped_s(whole, frames, rate), float(_dropped_s(np.array(DAY_S), np.array(0.0), rate))
    over = np.concatenate([[0.0], np.cumsum(np.diff(time_s) < -DAY_S / 2)])
    return time_s + day_s * over


def _dropped_s(whole: Array, frames: Array, rate: int) -> Array:
    """Return drop-frame timecodes in seconds: every minute but each tenth leaves out numbers 0 and 1 (SMPTE 12M)."""
    minutes = np.floor(whole / 60)
    dropped = rate / 15 * (minutes - np.floor(minutes / 10))
    return (whole * rate + frames - dropped) * 1001 / (1000 * rate)


def _drops_frames(whole: Array, frames: Array, rate: int) -> bool:
    """Return whether every full minute but each tenth follows the last frame of a second with frame 2 (4 of 60)."""
    first = np.flatnonzero((np.diff(whole) == 1) & (whole[1:] % 60 == 0) & (whole[1:] % 600 != 0)) + 1
    jumps = (frames[first - 1] >= rate - 1) & (np.floor(frames[first]) == rate // 15)
    return rate in {30, 60} and bool(len(first)) and bool(jumps.all())


def _in_order(time_s: Array) -> NDArray[np.bool_]:
    """Return which rows are later than all before them. Raises InputError: a row goes far back, or too many do."""
    latest = np.maximum.accumulate(time_s)
    back = latest - time_s
    if back.max() > BACKWARDS_S:
        row = int(np.argmax(back > BACKWARDS_S))
        raise InputError(f"the time of row {row + 1} goes back by {back[row]:.2f} s, required: one take in order")
    ordered = np.concatenate([[True], time_s[1:] > latest[:-1]])
    left_out = int((~ordered).sum())
    if left_out:
        row = int(np.argmin(ordered)) + 1
        what = f"{left_out} of {len(time_s)} rows are not later than those before, as row {row}"
        if left_out > max(LEFT_OUT, LEFT_OUT_SHARE * len(time_s)):
            raise InputError(f"{what}; required: times that increase")
        LOG.warning("%s: they are left out", what)
    return np.asarray(ordered)
