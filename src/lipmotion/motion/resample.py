"""From the camera's frames to those of the models."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def to_model_frames(
    values: NDArray[np.float64], seen: NDArray[np.bool_], rate_hz: float, frames: int, frame_rate_hz: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return curves at another rate by a cubic spline, and where they rest on frames that were seen.

    values : [shape=(T, P)] at ``rate_hz``;  seen : [shape=(T,)]
    Returns [shape=(frames, P)] at ``frame_rate_hz``, and bool [shape=(frames,)].
    The spline is C²: linear interpolation would make Δ² zero nearly everywhere. Beyond the last camera frame
    the last value holds, and counts as unseen from half a camera frame on.
    """
    from scipy.interpolate import CubicSpline

    camera_s = np.arange(len(values)) / rate_hz
    wanted_s = np.arange(frames) / frame_rate_hz
    inside_s = np.minimum(wanted_s, camera_s[-1])
    curves = CubicSpline(camera_s, values)(inside_s) if len(values) > 1 else np.repeat(values, frames, axis=0)
    nearest = np.floor(wanted_s * rate_hz + 0.5).astype(int)
    valid = seen[np.minimum(nearest, len(seen) - 1)] & (nearest < len(seen))
    return curves, valid
