"""How sure generated motion is: the error to be expected of it, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Curve = NDArray[np.float64]
VARIANCE_FACTOR = 8.0
"""Squared error of a voice that training knows, for each unit of the model's own variance: its frames count as
independent of one another, and are not."""
STRANGER, STRANGER_MOVEMENT, STRANGER_DOUBT = 0.45, 0.75, 0.15
"""Squared error, in the variance of the curve, of a voice that training does not know at all: in every frame, for each
unit of squared distance from the mean, and where no phone is sure."""
OTHER_WORDS = 0.5
"""Squared error that a transcript of something else adds: 0.5 on average of eight strangers, 0.2 for a known voice."""
LEAST_DEVIATION = 0.02
"""A curve that moves less, in eye distances or as a weight, counts as moving so far."""


@dataclass(frozen=True)
class SpeechKnowledge:
    """How well a model knows what is said and who speaks.

    voice  : 0 to 1, how well training knows the voice (``Speech.voice``)
    phones : 0 to 1, how sure the phones are (``Speech.confidence``), on average; 1 where they are known
    fit    : 0 to 1, how far the transcript or given phones fit, in all or in each frame; 1 where there are none

    >>> import numpy as np
    >>> curve, variance = np.array([0.0, 0.1, 0.2, 0.1]), np.full(4, 1e-4)
    >>> SpeechKnowledge(voice=1.0, phones=1.0).confidence(curve, variance).round(2)
    array([0.86, 0.86, 0.86, 0.86])
    >>> SpeechKnowledge(voice=0.0, phones=0.9).confidence(curve, variance).round(2)
    array([0.32, 0.61, 0.32, 0.61])
    """

    voice: float
    phones: float
    fit: float | Curve = 1.0

    def confidence(self, curve: NDArray[np.floating], variance: NDArray[np.floating]) -> Curve:
        """Return how sure each frame of a curve is, 0 to 1 [shape=(T,)]: 1 / (1 + expected squared error).

        curve, variance : values and variances by the model [each shape=(T,)]
        The expected squared error is in units of the variance of the curve, so that 0.5 means an error as large as the
        movement. Its weights were measured on recordings whose motion is known (docs/results/voices.md).
        """
        weights = (VARIANCE_FACTOR, STRANGER, STRANGER_MOVEMENT, STRANGER_DOUBT)
        fit = np.atleast_1d(self.fit)[np.linspace(0, np.size(self.fit) - 1, len(curve)).round().astype(int)]
        return 1 / (1 + weights @ self.causes(curve, variance) + OTHER_WORDS * (1 - fit))

    def causes(self, curve: NDArray[np.floating], variance: NDArray[np.floating]) -> Curve:
        """Return the causes of squared error in each frame, before they are weighed [shape=(4, T)].

        They are the model's own variance and, as far as the voice is unknown: 1, the squared distance of the curve
        from its mean, and how unsure the phones are. Variance and distance are in the variance of the curve.
        """
        values = np.asarray(curve, float)
        unit = max(float(values.var()), LEAST_DEVIATION**2)
        distance = np.square(values - values.mean()) / unit
        one = np.ones(len(values))
        strange = (1 - self.voice) * np.stack([one, distance, (1 - self.phones) * one])
        return np.concatenate([np.maximum(variance, 0)[None] / unit, strange])
