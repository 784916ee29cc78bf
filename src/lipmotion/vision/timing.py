"""Frames at whatever times, put on a constant rate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATE_TOLERANCE = 0.05
"""A rate that the container states is believed when it is this close to the rate of its time stamps."""
TIME_TOLERANCE = 0.05
"""A frame this close to its place, in frames, is in its place: time stamps are rounded, often to 1 ms."""
CUBIC_GAP = 4.0
"""Gaps of up to this many frames are bridged by a cubic; in longer ones it could swing, so they get a straight line."""
RATE_WHEN_UNKNOWN_HZ = 25.0
LOWEST_HZ, HIGHEST_HZ = 1.0, 1000.0
"""Less often seen, no lips move; no camera is faster. Other rates are those of wrong time stamps."""


def nominal_rate_hz(times_s: Array, stated_rates_hz: Sequence[float]) -> float:
    """Return the constant frame rate that the time stamps belong to, dropped frames or not.

    times_s         : times of the decoded frames, rising
    stated_rates_hz : rates to believe, in this order, when one fits the median interval of the times
    """
    if len(times_s) < 2:
        return stated_rates_hz[0] if stated_rates_hz else RATE_WHEN_UNKNOWN_HZ
    measured = 1.0 / float(np.median(np.diff(times_s)))
    fitting = [rate for rate in stated_rates_hz if abs(rate / measured - 1) <= RATE_TOLERANCE]
    return fitting[0] if fitting else measured


def frame_count(times_s: Array, rate_hz: float) -> int:
    """Return how many frames of the constant rate, the first at 0 s, reach to the last time."""
    return round(float(times_s[-1]) * rate_hz) + 1


def nearest_indices(times_s: Array, wanted_s: Array) -> NDArray[np.intp]:
    """Return the index of the time nearest to each wanted time [shape=(len(wanted_s),)]."""
    after = np.clip(np.searchsorted(times_s, wanted_s), 1, max(len(times_s) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(times_s) - 1)
    return np.where(wanted_s - times_s[before] <= times_s[after] - wanted_s, before, after)


def resample_to_constant_rate(times_s: Array, values: Array, rate_hz: float, count: int) -> Array:
    """Return the values at n / rate_hz seconds.

    times_s : array [shape=(S,)], rising
    values  : array [shape=(S, P)]
    Returns array [shape=(count, P)]: frames that are in their place unchanged, others by a cubic spline through all
    (a straight line across long gaps), constant before the first and after the last.
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
