"""Tables of curves over time: lipmotion's own, takes of Live Link Face, and what other programs write.

``.csv``: a table for spreadsheets and scripts: ``time_s`` and one column per channel, without units.
``.livelink.csv``: a take as the app Live Link Face records it, for Unreal and for all that reads such takes.

A take begins ``Timecode,BlendshapeCount,EyeBlinkLeft,…``. A timecode is ``HH:MM:SS:FF.mmm``: FF frames of the
timecode's rate, and thousandths of a frame.
Read are also Audio2Face-3D's ``animation_frames.csv`` (``,timeCode,blendShapes.JawOpen,…``), scripts around MediaPipe
(``frame,timestamp_ms,_neutral,browDownLeft,…``, or one blendshape a row with its score), and any other with a column of
times. Source: files of these programs.
"""

from __future__ import annotations

import logging
import re
from array import array
from collections.abc import Iterator, Mapping
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ExportError, InputError, shorten
from lipmotion.formats import steady_rate
from lipmotion.formats.base import MotionFormat, format_rows
from lipmotion.formats.steady_rate import SEEN, TIME_COLUMN, is_unseen
from lipmotion.meshes.model.shape_names import ARKIT_52, is_known, to_arkit
from lipmotion.storage.text_table import LONGEST_LINE, open_table, parse_numbers
from lipmotion.types import EYE_DISTANCE, WEIGHT, Channel, Generation, Motion, Timeline, Unit

Array = NDArray[np.float64]
LOG = logging.getLogger("lipmotion")
TIME = "time_s"  # the first column
LONGEST_S = 1e6  # largest time that is accepted: more than eleven days
_SWAPPED = {"jawLeft": "jawRight", "jawRight": "jawLeft", "mouthLeft": "mouthRight", "mouthRight": "mouthLeft"}
_ANGLES = (f"{part}{angle}" for part in ("Head", "LeftEye", "RightEye") for angle in ("Yaw", "Pitch", "Roll"))
CURVES = (*((name := _SWAPPED.get(each, each))[:1].upper() + name[1:] for each in ARKIT_52), *_ANGLES)
"""The 61 curves in the order of the app's own takes: ARKit's 52 blendshapes, then angles of head and eyes."""
TICKS_HZ = 60
"""The frames of a timecode are counted in 60ths of a second at any rate: Unreal's importer divides them by 60."""
TAKE_DECIMALS = 6
BEFORE_CURVES = ("Timecode", "BlendshapeCount")
NO_CURVES = re.compile(
    rf"(?:|unnamed:?0|(?:frame|face)?(?:index|idx|id|number|no|num)?s?|neutral|{SEEN}|{TIME_COLUMN.pattern})"
)
"""Names of columns that are not curves: numbers of frames and faces, further times, whether there is a face."""
SCORES = ("score", "value", "weight", "coefficient")
TIMECODE_RATES = (24, 25, 30, 48, 50, 60, 120)
APP_RATE = 60  # frames a second of the timecode where a take does not show it: what the app has by default
DAY_S = 86_400.0
MISREAD_ROWS = 10  # more rows a second apart are frames, of which a spreadsheet made seconds
MAX_CURVES = 2000
_TIMECODE = re.compile(r"(\d{1,2})[:;](\d{1,2})[:;](\d{1,2})(?:([:;.,])(\d{1,9}(?:[.,]\d{1,9})?))?", re.ASCII)


def check_table(motion: Motion) -> None:
    """Raise ExportError if a channel's name would break the header."""
    for name in motion.names:
        if not name or set(name) & set(',;"') or not name.isprintable() or name != name.strip():
            raise ExportError(f"the channel name {shorten(name)!r} does not fit in a table; write .json or .npz")
    if len(",".join([TIME, *motion.names])) >= LONGEST_LINE:
        raise ExportError(f"the channel names do not fit in a line of {LONGEST_LINE} letters; write .json or .npz")


def write_table(path: Path, generation: Generation, _source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write a header and one line per frame."""
    motion = generation.motion
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join([TIME, *motion.names]) + "\n")
        for time_s, row in zip(motion.time_s.tolist(), format_rows(motion.values), strict=True):
            shortest = f"{time_s:.9f}".rstrip("0").rstrip(".")
            file.write(f"{shortest},{row}\n")


def read_table_motion(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return the motion of a table and an empty timeline.

    Channels with ARKit's names are weights, all others are eye distances. Tables of other programs are read as
    ``read_curve_table`` says.
    Raises InputError: not a table of numbers with a header, or times that are not even.
    """
    with open_table(path) as table:
        if table.names[0] != TIME or len(table.names) < 2:
            return read_curve_table(path)[0], Timeline(())
        columns, numbers = len(table.names), array("d")
        for line, fields in table.rows:
            if len(fields) != columns:
                raise ValueError(f"line {line} has {len(fields)} fields, required {columns} numbers in each")
            numbers.extend(parse_numbers(fields, line))
        values = np.frombuffer(numbers, np.float64).reshape(-1, columns) if numbers else np.empty((0, columns))
        channels = tuple(Channel(name, WEIGHT if to_arkit(name) else EYE_DISTANCE) for name in table.names[1:])
    time_s = values[:, 0]
    if len(time_s) < 2:
        raise InputError("the table has fewer than two rows, so its frame rate is unknown; use .json or .npz")
    if not np.abs(time_s).max() < LONGEST_S:
        raise InputError(f"the column time_s holds values that are no times, required seconds up to {LONGEST_S:.0f}")
    step_s = (time_s[-1] - time_s[0]) / (len(time_s) - 1)
    if time_s[0] != 0 or not step_s > 0 or np.abs(np.diff(time_s) - step_s).max() > 1e-6:
        raise InputError("the column time_s must begin at 0 and rise in even steps")
    return Motion(values[:, 1:], steady_rate.exact_rate(round(float(1 / step_s), 6)), channels), Timeline(())


def format_timecode(time_s: float) -> str:
    """Return a time as the app writes it, ``HH:MM:SS:FF.mmm``, with ``FF.mmm`` in 60ths of a second."""
    seconds, part = divmod(round(time_s * TICKS_HZ * 1000), TICKS_HZ * 1000)
    frames, part = divmod(part, 1000)
    return f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}:{frames:02d}.{part:03d}"


def write_take(path: Path, generation: Generation, _source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write a header and one line a frame; curves that the motion does not have are 0."""
    motion = generation.motion
    still = np.zeros(len(motion.values))
    curves = {name[:1].upper() + name[1:]: motion[name] for name in motion.names}
    table = np.stack([curves.get(name, still) for name in CURVES], axis=1)
    form = ",".join([f"%.{TAKE_DECIMALS}f"] * len(CURVES))
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(",".join([*BEFORE_CURVES, *CURVES]) + "\n")
        for time_s, row in zip(motion.time_s.tolist(), table + 0.0, strict=True):
            file.write(f"{format_timecode(time_s)},{len(CURVES)},{form % tuple(row.tolist())}\n")


def is_live_link_file(path: Path) -> bool:
    """Return whether a file is a table with the columns of Live Link Face; a file that cannot be read is none."""
    try:
        with open_table(path) as table:
            names = table.names
    except (OSError, ValueError):
        return False
    first, count = (name.lower() for name in BEFORE_CURVES)  # capitals differ between versions of the app
    lower = [name.lower() for name in names[:2]]
    return lower[:1] == [first] and (lower[1:] in ([], [count]) or (is_known(names[1]) and "." not in names[1]))


def read_curve_table(path: Path) -> tuple[Motion, NDArray[np.bool_]]:
    """Return the curves of a table at a steady rate from its first row on, and in which frames a face was seen.

    Names that are understood become ARKit's. Angles have the unit ``radian``; all others are weights in a take of Live
    Link Face, and else eye distances where they are no blendshapes. What is done with rows without a face, and with
    times that are not even, ``resample_rows`` says.
    Raises InputError: not such a table, a field that is no number, times that go back, or gaps without end.
    """
    with open_table(path) as table:
        names = table.names
        keys = list(map(steady_rate.clean_column, names))
        timed = next((column for column, key in enumerate(keys) if TIME_COLUMN.fullmatch(key)), None)
        used = [n for n, key in enumerate(keys) if not NO_CURVES.fullmatch(key)]
        if timed is None or not 0 < len(used) <= MAX_CURVES:
            raise ValueError(
                f"the first line is {shorten(','.join(names))!r}, required 'time_s,opening,...', or curves "
                "beside a column of times: Timecode,BlendshapeCount,JawOpen,... or timestamp_ms,jawOpen,..."
            )
        flags = {n: key for n, key in enumerate(keys) if re.fullmatch(SEEN, key)}
        rows = _choose_face(table.rows, keys.index("faceid")) if "faceid" in keys else table.rows
        times, names, values = _read_rows(rows, names, timed, used, flags)
        coded = bool(re.search("[:;]", times[0][1]))
        if coded:
            time_s = _read_timecodes([_parse_timecode(text, line) for line, text in times])
            time_s = time_s - time_s[0]  # timecode counts from anywhere
        else:
            written = np.array([parse_numbers([text], line)[0] for line, text in times])
            time_s = steady_rate.convert_times(written, keys[timed])
        return steady_rate.resample_rows(names, time_s, values, WEIGHT if coded else EYE_DISTANCE)


def _choose_face(rows: Iterator[tuple[int, list[str]]], column: int) -> Iterator[tuple[int, list[str]]]:
    """Yield the rows of the first face; a warning says how many of others there are (OpenFace's)."""
    first, others = None, 0
    for line, fields in rows:
        face = fields[column].strip() if column < len(fields) else None
        first = first or face
        others += face != first
        if face == first:
            yield line, fields
    if others:
        LOG.warning("%d rows are of other faces than the first one (%s), and are left out", others, first)


def _read_rows(
    rows: Iterator[tuple[int, list[str]]], names: list[str], timed: int, used: list[int], flags: dict[int, str]
) -> tuple[list[tuple[int, str]], list[str], Array]:
    """Return the lines and times of the rows, and names and values of curves [shape=(N, P)]: NaN without a face."""
    times: list[tuple[int, str]] = []
    faces: list[int] = []
    numbers = array("d")
    for line, fields in rows:
        times.append((line, fields[timed].strip() if timed < len(fields) else ""))
        curves = [fields[column] for column in used if column < len(fields)]
        if not any(map(str.strip, curves)) or any(is_unseen(f, flags[n]) for n, f in enumerate(fields) if n in flags):
            continue
        if len(fields) != len(names):
            count = len(fields) - len(names) + len(used)
            raise ValueError(f"line {line} has {count} curves, required {len(used)}; delete it if it is the last")
        if not faces:
            texts = [column for column in used if _is_text(fields[column], names[column])]
            used = [column for column in used if column not in texts]
            if not used:
                raise ValueError(f"line {line} has no numbers beside the time")
            of_names = [c for c in texts if len(t := fields[c].strip()) > 1 and (is_known(t) or t == "_neutral")]
            if of_names:
                return _read_single_scores(chain([(line, fields)], rows), names, timed, of_names[0], used)
            if texts:
                named = ", ".join(shorten(names[column]) for column in texts)
                LOG.warning("%d columns hold text, not numbers, and are left out: %s", len(texts), named)
                curves = [fields[column] for column in used]
        faces.append(len(times) - 1)
        numbers.extend(parse_numbers(curves, line))
    if not times:
        raise ValueError("there are no rows")
    values = np.full((len(times), len(used)), np.nan)
    values[faces] = np.frombuffer(numbers, np.float64).reshape(len(faces), len(used)) if numbers else np.nan
    return times, [names[column] for column in used], values


def _is_text(field: str, name: str) -> bool:
    """Return whether a field is no number, in a column whose name does not promise one."""
    try:
        parse_numbers([field], 0)
    except ValueError:
        return not is_known(name)
    return False


def _read_single_scores(
    rows: chain[tuple[int, list[str]]], names: list[str], timed: int, named: int, used: list[int]
) -> tuple[list[tuple[int, str]], list[str], Array]:
    """Return what ``_read_rows`` does of a table with one blendshape a row: its name, its score in another column."""
    score = next((column for column in used if names[column].strip().lower() in SCORES), used[-1])
    frames: dict[str, dict[str, float]] = {}
    lines: dict[str, int] = {}
    for line, fields in rows:
        if len(fields) <= max(timed, named, score):
            raise ValueError(f"line {line} has {len(fields)} fields, required {len(names)}")
        time = fields[timed].strip()
        lines.setdefault(time, line)
        frames.setdefault(time, {})[fields[named].strip()] = parse_numbers([fields[score]], line)[0]
    known, values = steady_rate.tabulate_frames(list(frames.values()))
    return [(line, time) for time, line in lines.items()], known, values


def _parse_timecode(text: str, line: int) -> tuple[int, float, str]:
    """Return whole seconds since midnight, frames (fractions included), and what stands before the frames."""
    code = _TIMECODE.fullmatch(text)
    if code is None or int(code[2]) > 59 or int(code[3]) > 59:
        what = f"line {line} begins with {shorten(text)!r}, required a timecode as 12:30:59:29.500;"
        raise ValueError(f"{what} spreadsheets shorten it: take the file as it was recorded")
    seconds, mark = (int(code[1]) * 60 + int(code[2])) * 60 + int(code[3]), code[4] or ""
    if mark and mark in ".,":
        return seconds, float("0." + re.sub("[.,]", "", code[5])), "."
    return seconds, float(code[5].replace(",", ".")) if mark else 0.0, mark


def _read_timecodes(codes: list[tuple[int, float, str]]) -> Array:
    """Return timecodes as seconds since the midnight before the first [shape=(N,)]."""
    seconds, frames = (np.array([code[part] for code in codes], float) for part in (0, 1))
    day_s, mark = DAY_S, codes[0][2]
    if mark == "." and len(codes) > MISREAD_ROWS and (frames == frames[0]).all():
        mark = ""
    hundredths, passes = np.rint(100 * frames), np.count_nonzero(np.diff(seconds))
    if mark == "." and passes > 1 and hundredths.max() + 1 in TIMECODE_RATES and np.allclose(hundredths, 100 * frames):
        frames, mark = hundredths, ":"
    if not mark and len(codes) > MISREAD_ROWS and np.median(np.diff(seconds)) == 1:
        LOG.warning("rows are a second apart: the last field of the timecodes is taken for frames (MM:SS:FF)")
        seconds, frames, mark = seconds // 60, seconds % 60, ":"
    if not mark:
        starts = np.flatnonzero(np.diff(seconds)) + 1
        if len(starts) < 2:
            raise ValueError("the timecodes have no frames (HH:MM:SS), required HH:MM:SS:FF: a spreadsheet cut them")
        rate = (starts[-1] - starts[0]) / ((seconds[starts[-1]] - seconds[starts[0]]) % DAY_S)
        LOG.warning("the timecodes have no frames: %d rows are taken as even, %.2f a second", len(seconds), rate)
        return np.asarray(np.arange(len(seconds)) / rate)
    if mark == ".":
        time_s = seconds + frames
    else:
        counts = np.unique(frames)  # some programs count from 1
        frames = frames - (counts[-1] in TIMECODE_RATES and np.array_equal(counts, np.arange(1, counts[-1] + 1)))
        passed = np.flatnonzero(np.diff(seconds) == 1)
        last = int(frames[passed].max() if len(passed) == 1 else frames.max())
        if last >= TIMECODE_RATES[-1]:
            raise InputError(f"a timecode has frame {last}, required less than {TIMECODE_RATES[-1]}")
        counted = next(rate for rate in TIMECODE_RATES if rate > last)
        rate = counted if len(passed) else max(counted, APP_RATE)
        if rate > counted:
            LOG.warning("the timecodes pass no whole second: %d frames a second are assumed", rate)
        time_s = seconds + frames / rate
        # every full minute but each tenth follows the last frame of a second with frame 2 (4 of 60)
        first = np.flatnonzero((np.diff(seconds) == 1) & (seconds[1:] % 60 == 0) & (seconds[1:] % 600 != 0)) + 1
        jumps = (frames[first - 1] >= rate - 1) & (np.floor(frames[first]) == rate // 15)
        if mark == ";" or (rate in {30, 60} and len(first) and jumps.all()):
            time_s = _drop_frames(seconds, frames, rate)
            day_s = float(_drop_frames(np.array(DAY_S), np.array(0.0), rate))
    over = np.concatenate([[0.0], np.cumsum(np.diff(time_s) < -DAY_S / 2)])
    return time_s + day_s * over


def _drop_frames(seconds: Array, frames: Array, rate: int) -> Array:
    """Return drop-frame timecodes in seconds: every minute but each tenth leaves out numbers 0 and 1 (SMPTE 12M)."""
    minutes = np.floor(seconds / 60)
    dropped = rate / 15 * (minutes - np.floor(minutes / 10))
    return (seconds * rate + frames - dropped) * 1001 / (1000 * rate)


TABLE = MotionFormat(write_table, read_table_motion, check_table)
LIVE_LINK = MotionFormat(write_take, read_table_motion, curves="face", rate_hz=float(TICKS_HZ))
