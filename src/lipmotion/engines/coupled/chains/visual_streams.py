"""What is seen, as streams that chains emit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import Observed
from lipmotion.motion.space import MotionSpace
from lipmotion.stats.delta_windows import with_dynamics
from lipmotion.types import EYE_DISTANCE, GREY

Array = NDArray[np.float64]
LEAST_DEVIATION = 1e-6
GEOMETRY, EIGENLIPS = "geometry", "eigenlips"


@dataclass(frozen=True, eq=False)
class VisualStream:
    """Some dimensions of the motion's space as one stream, standardised.

    name    : ``geometry`` (lengths and points, or curves), or the unit of what else there is (``grey``: eigenlips)
    columns : of the Q dimensions of the space [shape=(q,)]
    dynamic : whether slope and curvature stand beside each value
    mean, deviation : float arrays [shape=(D,)], D = 3·q with dynamics (all values, all slopes, all curvatures)
    """

    name: str
    columns: NDArray[np.intp]
    dynamic: bool
    mean: Array
    deviation: Array

    def observed(self, values: Array) -> NDArray[np.float32]:
        """Return motion in the space [shape=(T, Q)] as this stream [shape=(T, D)]."""
        rows = stream_rows(values[:, self.columns], self.dynamic)
        return ((rows - self.mean) / self.deviation).astype(np.float32)

    def restored(self, means: Array, precisions: Array) -> tuple[Array, Array]:
        """Return means and precisions [each shape=(T, D)] in the motion's own units [each shape=(T, 3, q)].

        Without dynamics, slope and curvature have no precision.
        """
        windows = 3 if self.dynamic else 1
        mean = (means * self.deviation + self.mean).reshape(len(means), windows, -1)
        precision = (precisions / self.deviation**2).reshape(len(means), windows, -1)
        if self.dynamic:
            return mean, precision
        missing = np.zeros((len(means), 2, mean.shape[2]))
        return np.concatenate([mean, missing], axis=1), np.concatenate([precision, missing], axis=1)


def stream_rows(values: Array, dynamic: bool) -> Array:
    """Return values [shape=(T, q)] as the rows of a stream, not standardised."""
    return with_dynamics(values).reshape(len(values), -1) if dynamic else values


def visual_streams(
    space: MotionSpace, values: Sequence[Array], seen: Sequence[NDArray[np.bool_]], dynamic: bool
) -> tuple[VisualStream, ...]:
    """Return the streams of some motion in its space [each shape=(T, Q)], standardised where it was seen."""
    units = [space.channels[channel].unit for channel in space.direct]
    other = [unit if unit == GREY else EYE_DISTANCE for unit in units]
    kinds = np.array([*other, *[EYE_DISTANCE] * (space.dimensions - len(units))])
    streams = []
    for kind in dict.fromkeys(kinds.tolist()):
        columns = np.flatnonzero(kinds == kind)
        rows = np.concatenate([stream_rows(x[:, columns], dynamic)[mask] for x, mask in zip(values, seen, strict=True)])
        deviation = np.maximum(rows.std(axis=0), LEAST_DEVIATION)
        name = EIGENLIPS if kind == GREY else GEOMETRY
        streams.append(VisualStream(name, columns, dynamic, rows.mean(axis=0), deviation))
    return tuple(streams)


def unseen(features: NDArray[np.float32], visual: Sequence[VisualStream]) -> Observed:
    """Return speech [shape=(T, 39)] with nothing seen."""
    nothing = tuple(np.zeros((len(features), len(stream.mean)), np.float32) for stream in visual)
    return Observed((features, *nothing), (None, *(np.zeros(len(features), bool) for _ in nothing)))
