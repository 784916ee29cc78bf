"""Where a recording is too loud for silence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LOUD_SHARE = 0.5
"""A frame is loud where the smoothed log energy has risen this far from its 10th to its 95th percentile."""


def loud_frames(log_energy: NDArray[np.float32], smoothing: int) -> NDArray[np.bool_]:
    """Return which frames are loud for this recording.

    log_energy : [shape=(T,)], of any scale
    smoothing  : frames averaged over, an odd number
    """
    padded = np.pad(log_energy, smoothing // 2, "edge")
    smooth = np.convolve(padded, np.full(smoothing, 1 / smoothing), "valid")
    quiet, loud = np.quantile(smooth, [0.1, 0.95])
    return smooth > quiet + LOUD_SHARE * (loud - quiet)
