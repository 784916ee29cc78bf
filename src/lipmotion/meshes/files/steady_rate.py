"""Rows that come at uneven times, as rows at a steady rate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError

Array = NDArray[np.float64]

USUAL_RATES_HZ = (24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 90.0, 100.0, 120.0, 240.0)
"""Frame rates of cameras and of motion capture."""
TELEVISION_RATES_HZ = tuple(whole * 1000 / 1001 for whole in (24, 30, 48, 60, 120, 240))
"""Rates that even rows have where none of the usual ones fits."""
NEAR_RATE = 0.15
"""Uneven rows whose median rate is this near to a usual one, as a share, are put on a grid of that rate. Times stay."""
EVEN_SHARE = 0.1
"""Times that are this near to an even grid, as a share of a step, are even: the rows are taken as they are."""
ROUNDING_SHARE = 0.002
"""Rounding of times, as a share of a step: rows that are about as even at a usual rate have that rate."""
TELEVISION_RATIO, RATIO_OFF = 1.001, 0.0002
"""By how much sound is longer than motion whose timecode counts 30 where 29.97 frames pass, and how exactly so."""
SHORTEST_RATIO_S = 100.0
"""In less sound, 0.001 of it is no more than a frame or two."""
LONGEST_GAP = 3
"""Most frames of the steady rate for each row: a table whose time is mostly gaps is refused."""
SPARE_FRAMES = 600
"""Frames of gaps that are allowed besides, so that a short take may have a long gap."""


def exact_rate(hertz: float, off_hz: float = 1e-6) -> float:
    """Return a rate of television, N · 1000 / 1001 (29.97), that a rounded rate stands for, else the same rate.

    off_hz : by how much rounding may have changed it
    """
    television = float(np.rint(hertz * 1.001)) * 1000 / 1001
    return television if television and abs(television - hertz) <= off_hz else hertz


def rate_in_step(rate_hz: float, frames: int, duration_s: float) -> float:
    """Return the rate of motion that lasts as long as its sound but for 1001 / 1000, else the same rate.

    duration_s : of the sound
    Timecodes of television count whole numbers of frames a second (30), which pass in 1.001 s (at 29.97).
    """
    near = any(abs(rate_hz / each - 1) < 1.5 * (TELEVISION_RATIO - 1) for each in (24, 30, 48, 60, 120))
    for ratio in (TELEVISION_RATIO, 1 / TELEVISION_RATIO):
        off = abs(duration_s * rate_hz / ratio - frames)
        if near and duration_s >= SHORTEST_RATIO_S and off <= max(1.0, RATIO_OFF * frames):
            return exact_rate(round(rate_hz / ratio, 6), 1e-3)
    return rate_hz


def steady_rows(time_s: Array, rows: Array) -> tuple[Array, float]:
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
    off, *known_off = (_unevenness(passed_s, hertz) for hertz in (mean_hz, *known_hz))
    if min(off, known_off[0]) <= EVEN_SHARE:
        fits = (hertz for hertz, each in zip(known_hz, known_off, strict=True) if each <= 2 * off + ROUNDING_SHARE)
        return rows, next(fits, round(mean_hz, 6))
    hertz = 1 / float(np.median(steps))
    nearest = min(USUAL_RATES_HZ, key=lambda usual: abs(usual - hertz))
    if abs(nearest - hertz) <= NEAR_RATE * nearest:
        hertz = nearest
    frames = round(float(passed_s[-1]) * hertz) + 1
    if frames > LONGEST_GAP * len(time_s) + SPARE_FRAMES:
        raise InputError(
            f"{len(time_s)} rows in {passed_s[-1]:.1f} s at {hertz:g} rows a second: most of the time there are none; "
            "cut the take where it has gaps"
        )
    grid_s = np.arange(frames) / hertz
    return np.stack([np.interp(grid_s, passed_s, column) for column in rows.T], axis=1), round(hertz, 6)


def _unevenness(passed_s: Array, hertz: float) -> float:
    """Return how far times are from an even grid at most, as a share of a step."""
    return float(np.abs(passed_s * hertz - np.arange(len(passed_s))).max())
