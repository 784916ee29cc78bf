"""The guide: motion predicted from the sound, which the recorded motion of units is compared with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.selection.costs import FRACTIONS
from lipmotion.motion.predictors import Predictor
from lipmotion.types import FRAME_RATE_HZ, Example, Speech
from lipmotion.types.motion import interpolate_rows

Array = NDArray[np.float64]
LEAST_EXPANSION, MOST_EXPANSION = 1.0, 1.6
NEW_SPEECH_EXPANSION = 1.05
"""Predictions for new recordings are so much narrower again than those for recordings of the training."""


@dataclass(frozen=True, eq=False)
class Guide:
    """A predictor of motion; mean of the motion [shape=(Q,)], and its deviation by that of predictions [shape=(Q,)]."""

    predictor: Predictor
    centre: Array
    expansion: Array

    def predict(self, speech: Speech) -> tuple[Array, Array]:
        """Return the predicted motion [shape=(T, Q)] and the distortion of the sound, 0 to 1 [shape=(T,)]."""
        return self.predictor.predict(speech)

    def expanded(self, predicted: Array) -> Array:
        """Return predicted motion [shape=(..., Q)] as wide as recorded motion."""
        return self.centre + (predicted - self.centre) * self.expansion


def fit_guide(predictor: Predictor, examples: Sequence[Example], values: Sequence[Array]) -> Guide:
    """Return a guide."""
    recorded = np.concatenate([x[example.valid] for x, example in zip(values, examples, strict=True)])
    predicted = np.concatenate([predictor.predict(e.speech)[0][e.valid] for e in examples])
    ratio = NEW_SPEECH_EXPANSION * recorded.std(axis=0) / np.maximum(predicted.std(axis=0), 1e-9)
    return Guide(predictor, recorded.mean(axis=0), np.clip(ratio, LEAST_EXPANSION, MOST_EXPANSION))


def at_points(motion: Array, times_s: Array) -> Array:
    """Return motion of one recording [shape=(T, Q)] at the points of each of its phones [shape=(U, POINTS, Q)]."""
    start_s, end_s = times_s.T[:, :, None]
    points_s = start_s + FRACTIONS * (end_s - start_s)
    return interpolate_rows(motion, FRAME_RATE_HZ, points_s.ravel()).reshape(*points_s.shape, -1)
