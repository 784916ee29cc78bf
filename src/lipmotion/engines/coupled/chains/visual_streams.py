"""The visual streams that chains emit: motion in its space, standardised, with or without dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import AudioVisualObservations
from lipmotion.motion.space import MotionSpace
from lipmotion.stats.curves import with_dynamics
from lipmotion.types import EYE_DISTANCE, GREY, Speech

Array = NDArray[np.float64]
LEAST_DEVIATION = 1e-6
GEOMETRY, EIGENLIPS = "geometry", "eigenlips"


@dataclass(frozen=True, eq=False)
class VisualStream:
    """Some dimensions of the motion space as one standardised stream.

    name    : ``geometry`` (lengths and points, or curves) or ``eigenlips``
    columns : the dimensions, among the Q of the space [shape=(q,)]
    dynamic : whether the stream holds slope and curvature (Δ, Δ²) as well as each value
    mean, deviation : of the stream [shape=(D,)], D = q, or 3·q with dynamics (all values, all slopes, all curvatures)
    """

    name: str
    columns: NDArray[np.intp]
    dynamic: bool
    mean: Array
    deviation: Array

    def standardised(self, values: Array) -> NDArray[np.float32]:
        """Return motion in the space [shape=(T, Q)] as this standardised stream [shape=(T, D)]."""
        rows = stream_rows(values[:, self.columns], self.dynamic)
        return ((rows - self.mean) / self.deviation).astype(np.float32)

    def unstandardised(self, means: Array, precisions: Array) -> tuple[Array, Array]:
        """Return means and precisions of the stream [each shape=(T, D)] in units of the space [each shape=(T, 3, q)].

        Axis 1: value, slope, curvature. Without dynamics, slope and curvature have precision 0.
        """
        windows = 3 if self.dynamic else 1
        mean = (means * self.deviation + self.mean).reshape(len(means), windows, -1)
        precision = (precisions / self.deviation**2).reshape(len(means), windows, -1)
        if self.dynamic:
            return mean, precision
        missing = np.zeros((len(means), 2, mean.shape[2]))
        return np.concatenate([mean, missing], axis=1), np.concatenate([precision, missing], axis=1)


def stream_rows(values: Array, dynamic: bool) -> Array:
    """Return values [shape=(T, q)], with their dynamics if ``dynamic``, as rows of a stream [shape=(T, D)]."""
    return with_dynamics(values).reshape(len(values), -1) if dynamic else values


def fit_visual_streams(
    space: MotionSpace, values: Sequence[Array], valid: Sequence[NDArray[np.bool_]], dynamic: bool
) -> tuple[VisualStream, ...]:
    """Return the visual streams of some motion [each shape=(T, Q)], one a kind of channel, scaled on valid frames."""
    units = [space.channels[channel].unit for channel in space.direct]
    other = [unit if unit == GREY else EYE_DISTANCE for unit in units]
    kinds = np.array([*other, *[EYE_DISTANCE] * (space.dimensions - len(units))])
    streams = []
    for kind in dict.fromkeys(kinds.tolist()):
        columns = np.flatnonzero(kinds == kind)
        rows = np.concatenate(
            [stream_rows(x[:, columns], dynamic)[mask] for x, mask in zip(values, valid, strict=True)]
        )
        deviation = np.maximum(rows.std(axis=0), LEAST_DEVIATION)
        name = EIGENLIPS if kind == GREY else GEOMETRY
        streams.append(VisualStream(name, columns, dynamic, rows.mean(axis=0), deviation))
    return tuple(streams)


def speech_observations(
    speech: Speech, visual: Sequence[VisualStream], frames: slice = slice(None)
) -> AudioVisualObservations:
    """Return observations of some frames of speech in which no visual stream was observed."""
    features = np.asarray(speech.features.values)[frames]
    empty = tuple(np.zeros((len(features), len(stream.mean)), np.float32) for stream in visual)
    return AudioVisualObservations((features, *empty), (None, *(np.zeros(len(features), bool) for _ in empty)))
