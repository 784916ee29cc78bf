"""The motion space: the dimensions in which motion is modelled, its plausible limits; motion at the models' rate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import CorpusError, ModelFormatError
from lipmotion.motion.closure import OPENING, Closure
from lipmotion.stats.curves import mark_known_dynamics
from lipmotion.stats.pca import Pca, fit_pca
from lipmotion.types import FRAME_RATE_HZ, Channel, Example, Motion, Track, check_magnitude

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MotionSpace:
    """The dimensions of motion in a model: distances as they are, points reduced to principal components."""

    channels: tuple[Channel, ...]  # the P channels of the motion
    direct: NDArray[np.intp]  # int array [shape=(P',)], columns of the channels that are modelled as they are
    points: Pca | None  # principal components of all other channels, K of them (None: there are no others); Q = P' + K

    @property
    def direct_names(self) -> tuple[str, ...]:
        """The names of the channels that are modelled as they are."""
        return tuple(self.channels[channel].name for channel in self.direct)

    @property
    def dimensions(self) -> int:
        """The number of dimensions, Q."""
        return len(self.direct) + (len(self.points.basis) if self.points is not None else 0)

    def reduce(self, values: Array) -> Array:
        """Return motion of the channels [shape=(T, P)] in the motion space [shape=(T, Q)]."""
        direct = values[:, self.direct]
        if self.points is None:
            return direct
        return np.concatenate([direct, self.points.project(values[:, self._reduced])], axis=1)

    def restore(self, values: Array) -> Array:
        """Return motion of the channels [shape=(T, P)], from the motion space [shape=(T, Q)]."""
        motion, count = np.empty((len(values), len(self.channels))), len(self.direct)
        motion[:, self.direct] = values[:, :count]
        if self.points is not None:
            motion[:, self._reduced] = self.points.restore(values[:, count:])
        return motion

    @property
    def mixing(self) -> Array:
        """The matrix from variances of the dimensions to variances of the channels [shape=(Q, P)]."""
        mixing, count = np.zeros((self.dimensions, len(self.channels))), len(self.direct)
        mixing[np.arange(count), self.direct] = 1
        if self.points is not None:
            mixing[count:, self._reduced] = np.square(self.points.basis)
        return mixing

    @property
    def _reduced(self) -> NDArray[np.intp]:
        return np.setdiff1d(np.arange(len(self.channels)), self.direct)


def fit_space(channels: tuple[Channel, ...], poses: Array, components: int) -> MotionSpace:
    """Return the motion space of poses [shape=(N, P)]; points (``x_17``, ...) are reduced to principal components."""
    is_point = np.array([channel.name[:2] in ("x_", "y_", "z_") for channel in channels])
    points = fit_pca(poses[:, is_point], components) if is_point.any() else None
    return MotionSpace(channels, np.nonzero(~is_point)[0].astype(np.intp), points)


def fit_reduced_motion(examples: Sequence[Example], components: int) -> tuple[MotionSpace, list[Array]]:
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
    values: Array, seen: NDArray[np.bool_], rate_hz: float, frames: int
) -> tuple[Array, NDArray[np.bool_]]:
    """Return curves [shape=(T, P)] of a camera in ``frames`` frames at 100 Hz, and whether these are valid.

    seen : camera frames in which the face was measured [shape=(T,)]; a frame is valid if the nearest one was seen
    The spline is twice differentiable: with linear interpolation, Δ² would be zero nearly everywhere. After the last
    camera frame the last value is repeated; frames more than half a camera frame after the last one are not valid.
    """
    from scipy.interpolate import CubicSpline

    camera_s, model_s = np.arange(len(values)) / rate_hz, np.arange(frames) / FRAME_RATE_HZ
    clipped_s = np.minimum(model_s, camera_s[-1])
    curves = CubicSpline(camera_s, values)(clipped_s) if len(values) > 1 else np.repeat(values, frames, axis=0)
    nearest = np.floor(model_s * rate_hz + 0.5).astype(int)
    valid = seen[np.minimum(nearest, len(seen) - 1)] & (nearest < len(seen))
    return curves, valid


def resample_track(track: Track, frames: int) -> tuple[Motion, NDArray[np.bool_]]:
    """Return tracked motion in ``frames`` frames at 100 Hz, and the frames in which it is valid [shape=(frames,)]."""
    motion = track.motion
    values, valid = resample_to_model(np.asarray(motion.values, float), np.asarray(track.seen), motion.rate_hz, frames)
    return replace(motion, values=values, rate_hz=FRAME_RATE_HZ), valid


LARGEST_EXCESS = 20.0
"""Motion leaves the limits by at most so many spans of the poses; features unlike all training data give about 3."""
DEVIATIONS = 3.0  # standard deviations by which motion may leave the range of the poses
LARGEST_SPREAD = 1000.0
"""Largest median, over dimensions, of the span of the poses in standard deviations; our models have about 10."""
LARGEST_OFFSET = 1000.0  # largest magnitude of the mean of the points, in units of the largest span of a dimension
PLAUSIBLE_OPENING = 5.0  # eye distances; a larger opening is implausible unless the range of all poses is as large
NEGATIVE_SHARE = 0.05
"""Share of the span of the opening that may be negative where the opening is larger than ``PLAUSIBLE_OPENING``."""
LARGEST_REST_DISTANCE = 3.0  # largest distance of the rest pose from the range of the poses, in spans of that range
MIN_SPAN = 1e-3  # smallest span of a dimension, as a share of its largest magnitude or of 1


class MotionLimits(NamedTuple):
    """Smallest and largest value of each dimension of the motion space, of poses or motion [each shape=(Q,)]."""

    low: Array
    high: Array

    @property
    def span(self) -> Array:
        """Largest minus smallest value [shape=(Q,)]."""
        return self.high - self.low

    def extend(self, deviation: NDArray[np.floating]) -> MotionLimits:
        """Return limits extended by ``DEVIATIONS`` standard deviations [shape=(Q,)] on both sides."""
        return MotionLimits(self.low - DEVIATIONS * deviation, self.high + DEVIATIONS * deviation)

    def check(self, values: Array, closure: Closure | None, pins: Mapping[tuple[int, int], float]) -> None:
        """Check that motion is plausible: within ``LARGEST_EXCESS`` spans of the limits.

        values : motion in the motion space [shape=(T, Q)]
        pins   : values by frame and dimension; the limits are extended to contain them
        Raises ModelFormatError: the motion is not plausible, so that the model must be damaged.
        """
        low, high = self.low.copy(), self.high.copy()
        for (_, column), value in pins.items():
            low[column], high[column] = min(low[column], value), max(high[column], value)
        span = _floor_span(low, high)
        if closure is not None:
            span = np.maximum(span, np.abs(closure.follow) * (high - low)[closure.column] if pins else 0)
        worst = np.maximum(low - values.min(axis=0), values.max(axis=0) - high) / (LARGEST_EXCESS * span)
        if not worst.max() <= 1:
            column = int(worst.argmax())
            made = f"{values[:, column].min():g} to {values[:, column].max():g} in dimension {column}"
            required = f"required {low[column]:g} to {high[column]:g}: the model is damaged; train or download it again"
            raise ModelFormatError(f"the motion would go from {made}, {required}")


def measure_limits(poses: NDArray[np.floating]) -> MotionLimits:
    """Return the limits of some poses [shape=(N, Q)]."""
    return MotionLimits(poses.min(axis=0).astype(float), poses.max(axis=0).astype(float))


def check_poses(limits: MotionLimits, space: MotionSpace, closure: Closure | None) -> None:
    """Raise ValueError if the poses of a model cannot be those of a face, or contradict its space or closure."""
    count = len(space.direct)
    for column, channel in enumerate(space.direct):
        check_magnitude(space.channels[channel], float(limits.low[column]), float(limits.high[column]))
    if space.points is not None:
        largest, movement = float(np.abs(space.points.mean).max()), float(limits.span[count:].max(initial=0.0))
        if largest > max(PLAUSIBLE_OPENING, LARGEST_OFFSET * movement):
            raise ValueError(f"points_mean as large as {largest:g} of points that move by {movement:g}")
    if closure is not None:
        low, high = float(limits.low[closure.column]), float(limits.high[closure.column])
        span, plausible = high - low, max(-low, high) <= PLAUSIBLE_OPENING
        if not plausible and (low < -NEGATIVE_SHARE * span or low > LARGEST_EXCESS * span):
            raise ValueError(f"poses whose {OPENING} is {low:g} to {high:g}")
        if closure.closed > max(high + LARGEST_EXCESS * span, PLAUSIBLE_OPENING):
            raise ValueError(f"lips closed at {closure.closed:g}, with poses whose {OPENING} is {low:g} to {high:g}")


def check_rest(rest: Array, limits: MotionLimits) -> None:
    """Raise ValueError if the rest pose [shape=(Q,)] is far from all other poses."""
    distance = np.maximum(limits.low - rest, rest - limits.high) / _floor_span(limits.low, limits.high)
    column = int(distance.argmax())
    if distance[column] > LARGEST_REST_DISTANCE:
        poses = f"{limits.low[column]:g} to {limits.high[column]:g}"
        raise ValueError(f"rest pose of {rest[column]:g} in dimension {column}, whose poses are {poses}")


def _floor_span(low: Array, high: Array) -> Array:
    """Return ``high - low``; at least a thousandth of the largest magnitude, or of 1."""
    return np.maximum(high - low, MIN_SPAN * np.maximum(np.maximum(np.abs(low), np.abs(high)), 1))


def check_spread(poses: NDArray[np.floating], variances: NDArray[np.floating]) -> None:
    """Raise ValueError if means and variances of densities [each shape=(N, Q)] span far more deviations than usual."""
    deviation = np.sqrt(variances.mean(axis=0, dtype=float))
    spread = float(np.quantile(np.ptp(poses, axis=0) / deviation, 0.5))
    if spread > LARGEST_SPREAD:
        raise ValueError(f"means that span {spread:.0f} of their deviations, required at most {LARGEST_SPREAD:.0f}")
