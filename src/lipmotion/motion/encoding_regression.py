"""Motion of any voice, by a linear regression on what a speech encoder makes of the sound around each frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import CorpusError, InputError
from lipmotion.motion.network_steps import STEP, interpolate_steps, measure_error_variances
from lipmotion.motion.predictors import Predictor, PredictorFit, PredictorTraining
from lipmotion.storage.schema import POSITIVE, Arrays, ArraySpec, check_arrays
from lipmotion.types import Speech

Array = NDArray[np.float64]
REACH = 5
"""Time steps of 40 ms before and after a frame whose encoding is used: 200 ms."""
RIDGE = 0.01
"""Ridge parameter, as a share of the regressors' mean variance; 0.001 to 0.03 are alike (docs/results/voices.md)."""


@final
@dataclass(frozen=True, eq=False)
class EncodingRegression(Predictor):
    """Linear regression of motion on the encoding of the sound from 200 ms before a frame to 200 ms after it.

    coefficients : float32 array [shape=(R, Q)]
    centre       : the motion where all regressors are 0 [shape=(Q,)]
    variances    : of the error of static value, Δ and Δ² in training [shape=(3, Q)]
    """

    coefficients: NDArray[np.float32]
    centre: Array
    variances: Array
    name: ClassVar[str] = "encoding"
    ARRAYS: ClassVar[Mapping[str, ArraySpec]] = {
        "encoding_coefficients": ArraySpec(np.float32, "R Q", -1e4, 1e4),
        "encoding_centre": ArraySpec(np.float64, "Q", -1e6, 1e6),
        "encoding_variances": ArraySpec(np.float64, "3 Q", POSITIVE),
    }

    @classmethod
    def fit(cls, training: PredictorTraining) -> PredictorFit:
        """Return the regression. Raises CorpusError: an example without encoding."""
        products = targets = 0.0
        rows: list[tuple[Array, Array]] = []
        for example, values in zip(training.examples, training.values, strict=True):
            if example.speech.encoding is None:
                raise CorpusError("examples without encoding, which the predictor encoding needs")
            steps = np.arange(0, len(values), STEP)
            steps = steps[example.valid[steps]]
            rows.append((stack_encoding(example.speech)[steps // STEP], values[steps]))
        count = sum(len(x) for x, _ in rows)
        if not count:
            raise CorpusError("no frame with measured motion; train on recordings with a face")
        mean = sum(x.sum(axis=0) for x, _ in rows) / count
        centre = sum(y.sum(axis=0) for _, y in rows) / count
        for x, y in rows:
            products, targets = products + (x - mean).T @ (x - mean), targets + (x - mean).T @ (y - centre)
        penalty = RIDGE * np.trace(products) / len(mean)
        coefficients = np.linalg.solve(products + penalty * np.eye(len(mean)), targets)
        if 0 < training.direct < len(centre):  # jaw and points go with lips as they do in the training
            poses = np.concatenate([y for _, y in rows]) - centre
            lips = poses[:, : training.direct]
            coefficients = coefficients[:, : training.direct] @ np.linalg.lstsq(lips, poses, rcond=None)[0]
        fitted = cls(coefficients.astype(np.float32), centre - mean @ coefficients, np.ones((3, len(centre))))
        predicted = (fitted.predict(example.speech)[0] for example in training.examples)
        scale = np.sqrt(sum(np.square(y - centre).sum(axis=0) for _, y in rows) / count)
        variances = measure_error_variances(training, predicted, scale)
        return PredictorFit(cls(fitted.coefficients, fitted.centre, variances))

    def can_predict(self, speech: Speech) -> bool:
        """Return whether speech has an encoding."""
        return speech.encoding is not None

    def predict(self, speech: Speech) -> tuple[Array, Array]:
        """Return motion in the motion space [shape=(T, Q)], and no distortion: 0 [shape=(T,)].

        Raises InputError: speech without an encoding.
        """
        if speech.encoding is None:
            raise InputError("the speech has no encoding; an engine that uses one says so by ``inputs``")
        frames = len(speech.features.values)
        return speech.cached(self, lambda: self._predict(speech, frames)), np.zeros(frames)

    def _predict(self, speech: Speech, frames: int) -> Array:
        steps = stack_encoding(speech) @ self.coefficients.astype(float) + self.centre
        return interpolate_steps(steps, frames)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Serialise the regression; the coefficients at half precision."""
        return {
            "encoding_coefficients": self.coefficients.astype(np.float16),
            "encoding_centre": self.centre,
            "encoding_variances": self.variances,
        }

    @classmethod
    def from_arrays(cls, arrays: Arrays, dimensions: int) -> EncodingRegression:
        """Deserialise a regression; as ``Predictor.from_arrays``."""
        stored = check_arrays(arrays, cls.ARRAYS, Q=dimensions)
        return cls(*(stored[name] for name in cls.ARRAYS))


def stack_encoding(speech: Speech, reach: int = REACH, components: int | None = None) -> Array:
    """Return the encoding around every time step of 40 ms [shape=(ceil(T / 4), (2 · reach + 1) · components)].

    reach      : time steps before and after it
    components : the first ones that are used; None: all
    """
    encoding = np.asarray(speech.encoding)[::STEP, :components]
    around = np.clip(np.arange(len(encoding))[:, None] + np.arange(-reach, reach + 1), 0, len(encoding) - 1)
    return encoding[around].reshape(len(encoding), -1).astype(float)
