"""Motion from the frame rate of the camera to that of the models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import FRAME_RATE_HZ, Motion, Track


def resample_to_model(
    values: NDArray[np.float64], seen: NDArray[np.bool_], rate_hz: float, frames: int, frame_rate_hz: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return curves at the rate of a model by a cubic spline, and the frames that are valid.

    values : curves at ``rate_hz`` [shape=(T, P)]
    seen   : camera frames in which the face was measured [shape=(T,)]
    Returns curves at ``frame_rate_hz`` [shape=(frames, P)], and whether the nearest camera frame of each was seen
    [shape=(frames,)].
    The spline is twice differentiable: with linear interpolation, Δ² would be zero nearly everywhere. After the last
    camera frame the last value is repeated; half a camera frame later, frames are not valid.
    """
    from scipy.interpolate import CubicSpline

    camera_s = np.arange(len(values)) / rate_hz
    model_s = np.arange(frames) / frame_rate_hz
    clipped_s = np.minimum(model_s, camera_s[-1])
    curves = CubicSpline(camera_s, values)(clipped_s) if len(values) > 1 else np.repeat(values, frames, axis=0)
    nearest = np.floor(model_s * rate_hz + 0.5).astype(int)
    valid = seen[np.minimum(nearest, len(seen) - 1)] & (nearest < len(seen))
    return curves, valid


def resample_track(track: Track, frames: int) -> tuple[Motion, NDArray[np.bool_]]:
    """Return tracked motion in ``frames`` frames at 100 Hz, and the frames in which it is valid [shape=(frames,)]."""
    motion = track.motion
    values, valid = resample_to_model(
        np.asarray(motion.values, float), np.asarray(track.seen), motion.rate_hz, frames, FRAME_RATE_HZ
    )
    return replace(motion, values=values, rate_hz=FRAME_RATE_HZ), valid
