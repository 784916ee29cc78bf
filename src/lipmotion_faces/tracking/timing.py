"""Resampling of frames at irregular times to a constant rate."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError

Array = NDArray[np.float64]

RATE_TOLERANCE = 0.05
"""A frame rate that the container states is used when it differs from that of the time stamps by this share or less."""
TIME_TOLERANCE = 0.05
"""A frame this close to its nominal time, in frames, counts as on time: time stamps are often rounded to 1 ms."""
CUBIC_GAP = 4.0
"""Gaps of up to this many frames are interpolated by a cubic spline; in longer ones it could overshoot: linearly."""
RATE_WHEN_UNKNOWN_HZ = 25.0
LOWEST_HZ, HIGHEST_HZ = 1.0, 1000.0
"""Lowest and highest frame rate: lip motion needs more than the lowest, no camera is faster than the highest."""


def nominal_rate_hz(times_s: Array, stated_rates_hz: Sequence[float]) -> float:
    """Return the constant frame rate of the time stamps, even if frames were dropped.

    times_s         : times of the decoded frames, rising
    stated_rates_hz : of the container; the first that fits the median interval of the times is returned
    """
    if len(times_s) < 2:
        return stated_rates_hz[0] if stated_rates_hz else RATE_WHEN_UNKNOWN_HZ
    measured = 1.0 / float(np.median(np.diff(times_s)))
    fitting = [rate for rate in stated_rates_hz if abs(rate / measured - 1) <= RATE_TOLERANCE]
    return fitting[0] if fitting else measured


def check_rate(rate_hz: float, path: Path) -> None:
    """Raise InputError for a frame rate that no video of a face has: its time stamps are wrong."""
    if not LOWEST_HZ <= rate_hz <= HIGHEST_HZ:
        raise InputError(
            f"{path}: {rate_hz:g} pictures a second, required {LOWEST_HZ:g} to {HIGHEST_HZ:g}; export the video again"
        )


def frame_count(times_s: Array, rate_hz: float) -> int:
    """Return how many frames at a constant rate, the first at 0 s, there are up to the last time."""
    return round(float(times_s[-1]) * rate_hz) + 1


def nearest_indices(times_s: Array, wanted_s: Array) -> NDArray[np.intp]:
    """Return the index of the time nearest to each wanted time [shape=(len(wanted_s),)]."""
    after = np.clip(np.searchsorted(times_s, wanted_s), 1, max(len(times_s) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(times_s) - 1)
    return np.where(wanted_s - times_s[before] <= times_s[after] - wanted_s, before, after)


def resample_to_constant_rate(times_s: Array, values: Array, rate_hz: float, count: int) -> Array:
    """Return the values at the times n / rate_hz.

    times_s : array [shape=(S,)], rising
    values  : array [shape=(S, P)]
    count   : of frames returned
    Returns array [shape=(count, P)]: frames that are on time unchanged, others by a cubic spline through all (linear in
    long gaps), constant before the first and after the last.
    """
    from scipy.interpolate import CubicSpline

    wanted_s = np.clip(np.arange(count) / rate_hz, times_s[0], times_s[-1])
    index = nearest_indices(times_s, wanted_s)
    result: Array = values[index].copy()
    after = np.clip(np.searchsorted(times_s, wanted_s), 1, max(len(times_s) - 1, 1))
    moved = np.abs(times_s[index] - wanted_s) * rate_hz > TIME_TOLERANCE
    if not moved.any():
        return result
    wide = moved & ((times_s[after] - times_s[after - 1]) * rate_hz > CUBIC_GAP)
    result[moved] = CubicSpline(times_s, values)(wanted_s[moved])
    share = ((wanted_s - times_s[after - 1]) / (times_s[after] - times_s[after - 1]))[wide, None]
    result[wide] = (1 - share) * values[after[wide] - 1] + share * values[after[wide]]
    return result
