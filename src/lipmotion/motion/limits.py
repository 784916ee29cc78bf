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
WIDEST = 20.0
"""Motion stays within so many times the span of a model's poses; features unlike any of the training give about 3."""
DEVIATIONS = 3.0
"""Standard deviations by which motion may leave the poses."""
LARGEST_SPREAD = 1000.0
"""The poses of half of the dimensions span fewer of their own deviations than this: about ten in our models."""
LARGEST_OFFSET = 1000.0
"""The mean of points lies fewer of the largest span of a dimension away from 0."""
WIDE_OPEN = 5.0
"""Eye distances: a larger opening is implausible unless the other poses fit to it."""
NEGATIVE_SHARE = 0.05
FAR_REST = 3.0
"""The rest pose lies fewer spans of the poses away from them."""
LEAST_SPAN = 1e-3


class MotionLimits(NamedTuple):
    """The smallest and largest values of the poses, or of the motion, of a model.

    low, high : [shape=(Q,)]
    """

    low: Array
    high: Array

    @property
    def span(self) -> Array:
        """The difference of both [shape=(Q,)]."""
        return self.high - self.low

    def widened(self, deviation: NDArray[np.floating]) -> MotionLimits:
        """Return limits that are farther out by ``DEVIATIONS`` standard deviations on both sides."""
        return MotionLimits(self.low - DEVIATIONS * deviation, self.high + DEVIATIONS * deviation)

    def check(self, values: Array, closure: Closure | None, pins: Mapping[tuple[int, int], float]) -> None:
        """Raise ModelFormatError where motion [shape=(T, Q)] leaves the limits, widened by pins, by ``WIDEST`` spans."""
        low, high = self.low.copy(), self.high.copy()
        for (_, column), value in pins.items():
            low[column], high[column] = min(low[column], value), max(high[column], value)
        span = _span(low, high)
        if closure is not None:
            span = np.maximum(span, np.abs(closure.follow) * (high - low)[closure.column] if pins else 0)
        worst = np.maximum(low - values.min(axis=0), values.max(axis=0) - high) / (WIDEST * span)
        if not worst.max() <= 1:
            column = int(worst.argmax())
            raise ModelFormatError(
                f"the motion would go from {values[:, column].min():g} to {values[:, column].max():g} in dimension "
                f"{column}, its model reaches from {low[column]:g} to {high[column]:g}: the model is "
                "damaged; train or download it again"
            )


def limits_of(poses: NDArray[np.floating]) -> MotionLimits:
    """Return the smallest and largest values of poses [shape=(N, Q)]."""
    return MotionLimits(poses.min(axis=0).astype(float), poses.max(axis=0).astype(float))


def check_poses(limits: MotionLimits, space: MotionSpace, closure: Closure | None) -> None:
    """Raise ValueError where the poses of a model cannot be those of a face, or contradict its space or closure."""
    count = len(space.direct)
    for column, channel in enumerate(space.direct):
        check_magnitude(space.channels[channel], float(limits.low[column]), float(limits.high[column]))
    if space.points is not None:
        largest, moves = float(np.abs(space.points.mean).max()), float(limits.span[count:].max(initial=0.0))
        if largest > max(WIDE_OPEN, LARGEST_OFFSET * moves):
            raise ValueError(f"points_mean as large as {largest:g} of points that move by {moves:g}")
    if closure is not None:
        _check_opening(float(limits.low[closure.column]), float(limits.high[closure.column]), closure.closed)


def check_rest(rest: Array, limits: MotionLimits) -> None:
    """Raise ValueError where the rest pose [shape=(Q,)] is far from all other poses."""
    away = np.maximum(limits.low - rest, rest - limits.high) / _span(limits.low, limits.high)
    column = int(away.argmax())
    if away[column] > FAR_REST:
        raise ValueError(
            f"rest of {rest[column]:g} in dimension {column}, whose poses are {limits.low[column]:g} to "
            f"{limits.high[column]:g}"
        )


def _span(low: Array, high: Array) -> Array:
    """Return ``high - low``; at least a thousandth of the largest magnitude, or of 1."""
    return np.maximum(high - low, LEAST_SPAN * np.maximum(np.maximum(np.abs(low), np.abs(high)), 1))


def _check_opening(low: float, high: float, closed: float) -> None:
    span = high - low
    if max(-low, high) > WIDE_OPEN and (low < -NEGATIVE_SHARE * span or low > WIDEST * span):
        raise ValueError(f"poses whose {OPENING} is {low:g} to {high:g}")
    if closed > max(high + WIDEST * span, WIDE_OPEN):
        raise ValueError(f"lips that are closed at {closed:g}, with poses whose {OPENING} is {low:g} to {high:g}")


def check_spread(poses: NDArray[np.floating], variances: NDArray[np.floating]) -> None:
    """Raise ValueError where poses [shape=(N, Q)] span many more of their standard deviations than models do."""
    deviation = np.sqrt(variances.mean(axis=0, dtype=float))
    spread = float(np.median(np.ptp(poses, axis=0) / deviation))
    if spread > LARGEST_SPREAD:
        raise ValueError(f"means that span {spread:.0f} of their deviations, required at most {LARGEST_SPREAD:.0f}")
