"""Frames of a recording that are too loud for silence, or too quiet for speech."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

LOUD_SHARE = 0.5
"""A frame is loud where the smoothed log energy exceeds this share of the way from its 10th to its 95th percentile."""

LEAST_RISE = 1e-3
"""Energy with less between these percentiles, as natural logarithm or standardised, is constant but for rounding."""


def loud_frames(log_energy: NDArray[np.float32], smoothing: int, share: float = LOUD_SHARE) -> NDArray[np.bool_]:
    """Return which frames are loud [shape=(T,)]; none where the energy is constant but for rounding.

    log_energy : [shape=(T,)], of any scale
    smoothing  : frames averaged over, an odd number
    share      : how far above the quiet frames, of the way to the loud ones
    """
    padded = np.pad(log_energy, smoothing // 2, "edge")
    smooth = np.convolve(padded, np.full(smoothing, 1 / smoothing), "valid")
    quiet, loud = np.quantile(smooth, [0.1, 0.95])
    rise = loud - quiet
    return (rise > LEAST_RISE) & (smooth > quiet + share * rise)


QUIET_DISTANCE = 35 * np.log(10) / 10
"""Frames this far below the 95th percentile of log energy contain no speech: 35 dB, as natural logarithm of energy."""
QUIET_REACH_FRAMES = 10
"""A frame is quiet only if all frames within so many are: the closure of a stop is part of speech."""


def quiet_frames(log_energy: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return which frames are too quiet for speech [shape=(T,)].

    log_energy : [shape=(T,)], natural logarithm
    """
    padded = np.pad(log_energy, QUIET_REACH_FRAMES, "edge")
    loudest = sliding_window_view(padded, 2 * QUIET_REACH_FRAMES + 1).max(axis=1)
    return loudest < np.quantile(log_energy, 0.95) - QUIET_DISTANCE
