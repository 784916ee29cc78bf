"""Limits of plausible motion, from the poses of a model and from what faces can do."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ModelFormatError
from lipmotion.motion.closure import OPENING, Closure
from lipmotion.motion.space import MotionSpace
from lipmotion.types import check_magnitude

Array = NDArray[np.float64]
LARGEST_EXCESS = 20.0
"""Motion leaves the limits by at most so many spans of the poses; features unlike all training data give about 3."""
DEVIATIONS = 3.0
"""Standard deviations by which motion may leave the range of the poses."""
LARGEST_SPREAD = 1000.0
"""Largest median, over dimensions, of the span of the poses in standard deviations; our models have about 10."""
LARGEST_OFFSET = 1000.0
"""Largest magnitude of the mean of the points, in units of the largest span of a dimension."""
PLAUSIBLE_OPENING = 5.0
"""Eye distances; a larger opening is implausible unless the range of all poses is as large."""
NEGATIVE_SHARE = 0.05
"""Share of the span of the opening that may be negative where the opening is larger than ``PLAUSIBLE_OPENING``."""
LARGEST_REST_DISTANCE = 3.0
"""Largest distance of the rest pose from the range of the poses, in spans of that range."""
MIN_SPAN = 1e-3
"""Smallest span of a dimension, as a share of its largest magnitude or of 1."""


class MotionLimits(NamedTuple):
    """Smallest and largest values of the poses, or of the motion, of a model.

    low, high : smallest and largest value of each dimension of the motion space [each shape=(Q,)]
    """

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
        span = _span(low, high)
        if closure is not None:
            span = np.maximum(span, np.abs(closure.follow) * (high - low)[closure.column] if pins else 0)
        worst = np.maximum(low - values.min(axis=0), values.max(axis=0) - high) / (LARGEST_EXCESS * span)
        if not worst.max() <= 1:
            column = int(worst.argmax())
            raise ModelFormatError(
                f"the motion would go from {values[:, column].min():g} to {values[:, column].max():g} in dimension "
                f"{column}, its model reaches from {low[column]:g} to {high[column]:g}: the model is "
                "damaged; train or download it again"
            )


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
            raise ValueError(
                f"lips that are closed at {closure.closed:g}, with poses whose {OPENING} is {low:g} to {high:g}"
            )


def check_rest(rest: Array, limits: MotionLimits) -> None:
    """Raise ValueError if the rest pose [shape=(Q,)] is far from all other poses."""
    distance = np.maximum(limits.low - rest, rest - limits.high) / _span(limits.low, limits.high)
    column = int(distance.argmax())
    if distance[column] > LARGEST_REST_DISTANCE:
        raise ValueError(
            f"rest pose of {rest[column]:g} in dimension {column}, whose poses are {limits.low[column]:g} to "
            f"{limits.high[column]:g}"
        )


def _span(low: Array, high: Array) -> Array:
    """Return ``high - low``; at least a thousandth of the largest magnitude, or of 1."""
    return np.maximum(high - low, MIN_SPAN * np.maximum(np.maximum(np.abs(low), np.abs(high)), 1))


def check_spread(poses: NDArray[np.floating], variances: NDArray[np.floating]) -> None:
    """Raise ValueError if poses span many more of their standard deviations than those of trained models.

    poses, variances : means and variances of densities [each shape=(N, Q)]
    """
    deviation = np.sqrt(variances.mean(axis=0, dtype=float))
    spread = float(np.quantile(np.ptp(poses, axis=0) / deviation, 0.5))
    if spread > LARGEST_SPREAD:
        raise ValueError(f"means that span {spread:.0f} of their deviations, required at most {LARGEST_SPREAD:.0f}")
