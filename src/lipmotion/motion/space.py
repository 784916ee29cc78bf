"""The motion space: the dimensions in which motion is modelled; and motion at the frame rate of the models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import CorpusError
from lipmotion.stats.curves import mark_known_dynamics
from lipmotion.stats.pca import Pca, fit_pca
from lipmotion.types import FRAME_RATE_HZ, Channel, Example, Motion, Track


@dataclass(frozen=True, eq=False)
class MotionSpace:
    """The dimensions of motion in a model: distances as they are, points reduced to principal components.

    channels : the P channels of the motion
    direct   : int array [shape=(P',)], columns of the channels that are modelled as they are
    points   : principal components of all other channels, K of them (None: there are no others); Q = P' + K
    """

    channels: tuple[Channel, ...]
    direct: NDArray[np.intp]
    points: Pca | None

    @property
    def direct_names(self) -> tuple[str, ...]:
        """The names of the channels that are modelled as they are."""
        return tuple(self.channels[channel].name for channel in self.direct)

    @property
    def dimensions(self) -> int:
        """The number of dimensions, Q."""
        return len(self.direct) + (len(self.points.basis) if self.points is not None else 0)

    def reduce(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return motion of the channels [shape=(T, P)] in the motion space [shape=(T, Q)]."""
        direct = values[:, self.direct]
        if self.points is None:
            return direct
        return np.concatenate([direct, self.points.project(values[:, self._reduced])], axis=1)

    def restore(
        self, values: NDArray[np.float64], variance: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return values and variances of all channels [each shape=(T, P)].

        values, variance : in the motion space [each shape=(T, Q)]
        """
        motion, spread = (np.empty((len(values), len(self.channels))) for _ in range(2))
        count = len(self.direct)
        motion[:, self.direct], spread[:, self.direct] = values[:, :count], variance[:, :count]
        if self.points is not None:
            motion[:, self._reduced] = self.points.restore(values[:, count:])
            spread[:, self._reduced] = variance[:, count:] @ np.square(self.points.basis)
        return motion, spread

    @property
    def mixing(self) -> NDArray[np.float64]:
        """The matrix from variances of the dimensions to variances of the channels [shape=(Q, P)]."""
        mixing, count = np.zeros((self.dimensions, len(self.channels))), len(self.direct)
        mixing[np.arange(count), self.direct] = 1
        if self.points is not None:
            mixing[count:, self._reduced] = np.square(self.points.basis)
        return mixing

    @property
    def _reduced(self) -> NDArray[np.intp]:
        return np.setdiff1d(np.arange(len(self.channels)), self.direct)


def fit_space(channels: tuple[Channel, ...], poses: NDArray[np.float64], components: int) -> MotionSpace:
    """Return the motion space of some poses [shape=(N, P)]; all channels but points (``x_17``, ...) stay as they are.

    components : principal components that the points are reduced to
    """
    is_point = np.array([channel.name[:2] in ("x_", "y_", "z_") for channel in channels])
    points = fit_pca(poses[:, is_point], components) if is_point.any() else None
    return MotionSpace(channels, np.nonzero(~is_point)[0].astype(np.intp), points)


def fit_reduced_motion(examples: Sequence[Example], components: int) -> tuple[MotionSpace, list[NDArray[np.float64]]]:
    """Return the motion space of some examples, and the motion of each in it [each shape=(T, Q)].

    components : principal components that all point channels are reduced to
    Raises CorpusError: no example has valid motion, or the examples have different channels.
    """
    if not any(mark_known_dynamics(example.valid).any() for example in examples):
        raise CorpusError(f"none of {len(examples)} examples has motion to learn from; prepare a corpus with faces")
    channels = {example.motion.channels for example in examples}
    if len(channels) > 1:
        raise CorpusError("the utterances have different motion channels; train on one kind of corpus at a time")
    poses = np.concatenate([example.motion.values[example.valid] for example in examples])
    space = fit_space(channels.pop(), poses, components)
    return space, [space.reduce(example.motion.values.astype(float)) for example in examples]


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
