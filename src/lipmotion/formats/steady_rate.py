"""Rows of curves that come at uneven times, as motion at a steady rate."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten, shorten_list
from lipmotion.meshes.model.shape_names import is_known, to_arkit
from lipmotion.motion.frame_labels import find_runs
from lipmotion.types import EYE_DISTANCE, WEIGHT, Channel, Motion
from lipmotion.types.motion import RADIAN

Array = NDArray[np.float64]
LOG = logging.getLogger("lipmotion")
USUAL_RATES_HZ = (24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 90.0, 100.0, 120.0, 240.0)  # of cameras
TELEVISION_RATES_HZ = tuple(whole * 1000 / 1001 for whole in (24, 30, 48, 60, 120, 240))
"""Rates that even rows have where none of the usual ones fits."""
NEAR_RATE = 0.15
"""Uneven rows whose median rate is this near to a usual one, as a share, are put on a grid of that rate. Times stay."""
NEAR_MEAN = 0.01  # with gaps, the mean is lower; without any, it is truer than the median
EVEN_SHARE = 0.1
"""Times that are this near to an even grid, as a share of a step, are even: the rows are taken as they are."""
ROUNDING_SHARE = 0.002
"""Rounding of times, as a share of a step: rows that are about as even at a usual rate have that rate."""
TELEVISION_RATIO, RATIO_OFF = 1.001, 0.0002
"""By how much sound is longer than motion whose timecode counts 30 where 29.97 frames pass, and how exactly so."""
SHORTEST_RATIO_S = 100.0  # in less sound, 0.001 of it is no more than a frame or two
LONGEST_GAP = 3  # most frames of the steady rate for each row: a table whose time is mostly gaps is refused
SPARE_FRAMES = 600  # frames of gaps that are allowed besides, so that a short take may have a long gap
ANGLES = ("Yaw", "Pitch", "Roll")  # endings of the curves that are angles of the head and of the eyes
PER_SECOND = {"ms": 1e3, "msec": 1e3, "milliseconds": 1e3, "us": 1e6, "microseconds": 1e6, "ns": 1e9}
TIME_COLUMN = re.compile(
    rf"(?:(?:time(?:stamp|code)?|t)(?:s|secs?|seconds?|{'|'.join(PER_SECOND)})?|seconds?|milliseconds)"
)
"""Names of columns of times, without blanks, brackets and underscores."""
SEEN = r"(?:is|has|face)*(?:blendshapecount|success|confidence|valid|detected|track(?:ed|ing\w*)|found|present)|hasface"
"""Names of columns that say whether there is a face: where they hold 0, false or no, there is none (``is_unseen``)."""
LATEST_START_S = 60.0  # rows that begin later are cut from a longer take, or have the time of day
BACKWARDS_S = 0.5
"""A row whose time is earlier than that of the row before by less than this is left out; more is an error."""
LEFT_OUT_SHARE, LEFT_OUT = 0.1, 3  # so many rows may be left out: a share of all, or a few
LONGEST_STEP_S, SLOW_STEP_S = 2.0, 0.25
"""Rows that are further apart than the first have times in another unit than seconds; in it, they are nearer."""


def exact_rate(hertz: float, off_hz: float = 1e-6) -> float:
    """Return the rate of television, N · 1000 / 1001, that a rate rounded by ``off_hz`` stands for, or the rate."""
    television = float(np.rint(hertz * 1.001)) * 1000 / 1001
    return television if television and abs(television - hertz) <= off_hz else hertz


def match_sound_rate(rate_hz: float, frames: int, duration_s: float) -> float:
    """Return the rate of motion as long as its sound but for 1001 / 1000 (timecodes of television), else the same."""
    near = any(abs(rate_hz / each - 1) < 1.5 * (TELEVISION_RATIO - 1) for each in (24, 30, 48, 60, 120))
    for ratio in (TELEVISION_RATIO, 1 / TELEVISION_RATIO):
        off = abs(duration_s * rate_hz / ratio - frames)
        if near and duration_s >= SHORTEST_RATIO_S and off <= max(1.0, RATIO_OFF * frames):
            return exact_rate(round(rate_hz / ratio, 6), 1e-3)
    return rate_hz


def resample_evenly(time_s: Array, rows: Array) -> tuple[Array, float]:
    """Return rows at a steady rate that begin at the first time, and the rate in hertz.

    time_s : increasing, seconds [shape=(N,)];  rows : one for each time [shape=(N, P)]
    The rate of uneven rows is that of the median step, or the usual rate next to it. Rows that are
    even already are returned as they are; between others the values are linear, and gaps are bridged.
    Raises InputError: fewer than two rows, times that do not increase, or far more gaps than rows.
    """
    if len(time_s) < 2:
        raise InputError(f"{len(time_s)} rows with values, required two or more; their times say the frame rate")
    steps = np.diff(time_s)
    if not steps.min() > 0:
        row = int(np.argmin(steps)) + 2
        raise InputError(f"the time of row {row} is not after that of the row before, required: times that increase")
    passed_s = time_s - time_s[0]
    mean_hz = (len(time_s) - 1) / float(passed_s[-1])
    known_hz = [min(rates, key=lambda usual: abs(usual - mean_hz)) for rates in (USUAL_RATES_HZ, TELEVISION_RATES_HZ)]
    rows_at = np.arange(len(passed_s))  # how far times are from an even grid at most, as a share of a step
    off, *known_off = (float(np.abs(passed_s * hertz - rows_at).max()) for hertz in (mean_hz, *known_hz))
    if min(off, known_off[0]) <= EVEN_SHARE:
        fits = (hertz for hertz, each in zip(known_hz, known_off, strict=True) if each <= 2 * off + ROUNDING_SHARE)
        return rows, next(fits, round(mean_hz, 6))
    hertz = known_hz[0] if abs(mean_hz / known_hz[0] - 1) < NEAR_MEAN else 1 / float(np.median(steps))
    nearest = min(USUAL_RATES_HZ, key=lambda usual: abs(usual - hertz))
    if abs(nearest - hertz) <= NEAR_RATE * nearest:
        hertz = nearest
    frames = round(float(passed_s[-1]) * hertz) + 1
    if frames > LONGEST_GAP * len(time_s) + SPARE_FRAMES:
        what = f"{len(time_s)} rows in {passed_s[-1]:.1f} s at {hertz:g} rows a second:"
        raise InputError(f"{what} most of the time there are none; cut the take where it has gaps")
    missing = np.maximum(np.rint(steps * hertz) - 1, 0)
    if missing.any():
        spans = _name_spans([(passed_s[start], passed_s[stop]) for start, stop in find_runs(missing > 0)])
        LOG.warning("%d rows are missing, of %g a second, at %s: straight lines between", missing.sum(), hertz, spans)
    grid_s = np.arange(frames) / hertz
    return np.stack([np.interp(grid_s, passed_s, column) for column in rows.T], axis=1), round(hertz, 6)


def clean_column(name: str) -> str:
    """Return the name of a column as it is compared: ``Time (ms)`` is ``timems``."""
    return re.sub(r"[\s_()\[\].-]+", "", name).lower()


def is_unseen(flag: object, column: str) -> bool:
    """Return whether a flag, as text or of JSON, says that there is no face, in a column of such flags."""
    no = r"0+(?:[.,]0*)?|false|no?"
    return bool(re.fullmatch(SEEN, column) and re.fullmatch(no, str(flag).strip().lower()))


def tabulate_frames(frames: Sequence[Mapping[str, float]]) -> tuple[list[str], Array]:
    """Return the names of all curves of some frames, and their values [shape=(N, P)]; NaN where a frame has none."""
    names = [name for name in dict.fromkeys(name for frame in frames for name in frame) if name != "_neutral"]
    return names, np.array([[frame.get(name, np.nan) for name in names] for frame in frames], float)


def convert_times(times: Array, key: str) -> Array:
    """Return times in seconds, told by their column (``clean_column``) or their size. Raises InputError: no number."""
    if not np.isfinite(times).all():
        raise InputError(f"the time of row {int(np.argmin(np.isfinite(times))) + 1} is no number, required one in each")
    per_second = next((scale for unit, scale in PER_SECOND.items() if key.endswith(unit)), 1.0)
    step = float(np.median(np.diff(times))) / per_second if len(times) > 1 else 0.0
    if per_second == 1 and step > LONGEST_STEP_S:
        per_second = next((scale for scale in (1e3, 1e6, 1e7, 1e9) if step / scale <= SLOW_STEP_S), 1e9)
        LOG.warning("the times rise by %g a row: read as parts of a second, %g of them", step, per_second)
    return np.asarray(times / per_second)


def resample_rows(
    names: Sequence[str], time_s: Array, values: Array, unit: str = WEIGHT
) -> tuple[Motion, NDArray[np.bool_]]:
    """Return curves at a steady rate, and in which frames they were measured.

    time_s : of the rows, in seconds [shape=(N,)]; a later start than ``LATEST_START_S`` is that of the motion
    values : NaN where there is no face [shape=(N, P)]
    unit   : of curves that are neither blendshapes nor angles
    Before the first face and after the last one weights are 0 and other curves still; between faces is a straight line.
    Rows that are not later than all before are left out, frames that were lost and uneven times evened out
    (``resample_evenly``). A warning says how many rows each of this was.
    Raises InputError: a row goes far back, too many are left out, no rows, or most of the time has none.
    """
    ordered = _find_ordered(time_s)
    time_s, values = _extend_to_start(time_s[ordered], values[ordered])
    measured: NDArray[np.bool_] = np.asarray(np.isfinite(values).any(axis=0))
    if not measured.any():
        raise InputError("0 rows with values, required two or more")
    if not measured.all():
        empty = ", ".join(name for name, there in zip(names, measured, strict=True) if not there)
        LOG.warning("columns without any number are left out: %s", shorten(empty))
    names = [name for name, there in zip(names, measured, strict=True) if there]
    values = values[:, measured]
    channels = [_choose_channel(name, unit) for name in names]
    foreign = [column for column, channel in enumerate(channels) if channel.unit == EYE_DISTANCE]
    if foreign:
        what = f"{len(foreign)} columns have no name of a blendshape and count as eye distances, up to"
        LOG.warning("%s %g: %s", what, np.nanmax(values[:, foreign]), shorten_list([names[n] for n in foreign], 8))
    angles = [column for column, channel in enumerate(channels) if channel.unit == RADIAN]
    if angles and (largest := float(np.nanmax(np.abs(values[:, angles])))) > 2 * np.pi:
        LOG.warning("angles go up to %g: they are read as degrees", largest)
        values[:, angles] = np.deg2rad(values[:, angles])
    columns = choose_columns([channel.name for channel in channels], values)
    values, channels = values[:, columns], [channels[column] for column in columns]
    seen: NDArray[np.bool_] = np.asarray(np.isfinite(values).all(axis=1))
    if not seen.all():
        if not seen.any():
            raise InputError("0 rows with values of all curves, required two or more")
        passed_s = time_s - time_s[0]
        spans = _name_spans([(passed_s[start], passed_s[stop - 1]) for start, stop in find_runs(~seen)])
        what = "rows have no face or lack numbers, at %s: straight lines between, at rest before and after"
        LOG.warning(f"%d of %d {what}", int((~seen).sum()), len(seen), spans)
        for column in range(values.shape[1]):
            values[:, column] = np.interp(time_s, time_s[seen], values[seen, column])
        first, last = np.flatnonzero(seen)[[0, -1]]
        weights = np.array([channel.unit == WEIGHT for channel in channels])
        values[np.ix_((np.arange(len(seen)) < first) | (np.arange(len(seen)) > last), weights)] = 0.0
    rows, rate_hz = resample_evenly(time_s, np.concatenate([values, seen[:, None]], axis=1))
    return Motion(rows[:, :-1], rate_hz, tuple(channels)), rows[:, -1] > 0.5


def _extend_to_start(time_s: Array, values: Array) -> tuple[Array, Array]:
    """Return times and rows with empty rows before those that begin late, as where pictures have no face."""
    steps = np.diff(time_s)
    step_s = float(steps[steps < 1.5 * np.median(steps)].mean()) if len(steps) else np.inf
    count = round(time_s[0] / step_s) if step_s < time_s[0] <= LATEST_START_S else 0
    before_s = time_s[0] - step_s * np.arange(count, 0, -1)
    return np.concatenate([before_s, time_s]), np.pad(values, ((count, 0), (0, 0)), constant_values=np.nan)


def _name_spans(spans: Sequence[tuple[float, float]]) -> str:
    return shorten_list([f"{start_s:.2f}–{end_s:.2f} s" for start_s, end_s in spans], 4)


def _choose_channel(name: str, unit: str) -> Channel:
    if angle := re.fullmatch(rf"(.*?)(eye)?({'|'.join(ANGLES)})", name, re.IGNORECASE):
        part, eye = angle[1][:1].lower() + angle[1][1:], (angle[2] or "").title()
        return Channel(f"{part}{eye}{angle[3].title()}", RADIAN)
    return Channel(to_arkit(name) or name, WEIGHT if is_known(name) else unit)


def choose_columns(names: Sequence[str], values: Array) -> list[int]:
    """Return one column of each name, in order: where several have it, the one that moves most, with a warning."""
    if len(set(names)) == len(names):
        return list(range(len(names)))
    with np.errstate(invalid="ignore"):
        ranges = np.nanmax(values, axis=0, initial=-np.inf) - np.nanmin(values, axis=0, initial=np.inf)
    best: dict[str, int] = {}
    for column, name in enumerate(names):
        if name not in best or ranges[column] > ranges[best[name]]:
            best[name] = column
    twice = [name for name in best if sum(ranges[c] > 0 for c, other in enumerate(names) if other == name) > 1]
    if twice:
        LOG.warning("%d curves are there more than once: the one that moves most counts: %s", len(twice), twice[:8])
    return sorted(best.values())


def _find_ordered(time_s: Array) -> NDArray[np.bool_]:
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
