"""Motion by regression on the encoding of speech, or on what another model makes of it, for few recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import CorpusError, InputError
from lipmotion.motion.articulation import ARTICULATORS, trace_articulators
from lipmotion.motion.network_steps import STEP, check_scale, interpolate_steps, measure_error_variances
from lipmotion.motion.predictors import Predictor, PredictorFit, PredictorTraining, split_folds
from lipmotion.storage.schema import POSITIVE, Arrays, ArraySpec, check_arrays
from lipmotion.types import SPECTRUM_BANDS, Speech

REACH, COMPONENTS = 5, 64
"""Time steps of 40 ms before and after a frame whose encoding is used, 200 ms; and components of the encoding."""
RIDGE = 0.01
"""Ridge parameter, as a share of the regressors' mean variance; 0.001 to 0.03 are alike (docs/results/voices.md)."""


@final
@dataclass(frozen=True, eq=False)
class EncodingRegression(Predictor):
    """Linear regression of motion on the encoding of the sound from 200 ms before a frame to 200 ms after it."""

    coefficients: NDArray[np.float32]  # float32 array [shape=(704, Q)]
    centre: Array  # the motion where all regressors are 0 [shape=(Q,)]
    variances: Array  # of the error of static value, Δ and Δ² in training [shape=(3, Q)]
    name: ClassVar[str] = "encoding"
    needs: ClassVar[str] = "encoding"
    ARRAYS: ClassVar[Mapping[str, ArraySpec]] = {
        "encoding_coefficients": ArraySpec(np.float32, f"{(2 * REACH + 1) * COMPONENTS} Q", -1e4, 1e4),
        "encoding_centre": ArraySpec(np.float64, "Q", -1e6, 1e6),
        "encoding_variances": ArraySpec(np.float64, "3 Q", POSITIVE),
    }

    @classmethod
    def fit(cls, training: PredictorTraining) -> PredictorFit:
        """Return the regression. Raises CorpusError: an example without encoding."""
        rows: list[tuple[Array, Array]] = []
        for example, values in zip(training.examples, training.values, strict=True):
            if example.speech.encoding is None:
                raise CorpusError("examples without encoding, which the predictor encoding needs")
            measured = example.valid[::STEP]
            rows.append((stack_encoding(example.speech)[measured], values[::STEP][measured]))
        count = sum(len(x) for x, _ in rows)
        if not count:
            raise CorpusError("no frame with measured motion; train on recordings with a face")
        mean, centre = (sum(each.sum(axis=0) for each in arrays) / count for arrays in zip(*rows, strict=True))
        products = sum((x - mean).T @ (x - mean) for x, _ in rows)
        targets = sum((x - mean).T @ (y - centre) for x, y in rows)
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

    def predict(self, speech: Speech) -> tuple[Array, Array]:
        """Return motion [shape=(T, Q)], and no distortion: 0 [shape=(T,)]. Raises InputError: no encoding."""
        if speech.encoding is None:
            raise InputError("the speech has no encoding; an engine that uses one says so by ``inputs``")
        frames = len(speech.features.values)

        def follow() -> Array:
            steps = stack_encoding(speech) @ self.coefficients.astype(float) + self.centre
            return interpolate_steps(steps, frames)

        return speech.cached(self, follow), np.zeros(frames)

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


Array = NDArray[np.float64]
Fold = tuple[Array, Array]  # regressors and motion, in time steps, of some examples
WINDOW = 4  # time steps of 40 ms before and after a frame whose spectrum is used: 160 ms
ENCODING_REACH, ENCODING_COMPONENTS = 3, 32
"""Time steps before and after a frame whose encoding is used, and its principal components: a minute of speech says no
more of other ones (docs/results/voices.md)."""
RIDGES = tuple(10.0**power for power in range(0, 6))
"""Ridge parameters that cross-validation chooses from, one for each kind of regressors."""
INITIAL_RIDGE = 1000.0  # ridge parameter of all kinds before the choice
ROUNDS = 2
MIN_DEVIATION = 1e-3
KINDS = ("prior", "hidden", "articulation", "spectrum", "encoding")
"""Kinds of regressors: the articulators of the other model's motion, the last hidden layers of its networks, the table
of articulation for the phones in time, the spectrum and the encoding of the sound around the frame."""


@final
@dataclass(frozen=True, eq=False)
class PriorRegression(Predictor):
    """Ridge regression of motion on the output of another model (``Speech.prior``), the phones, and the sound."""

    sizes: tuple[int, ...]  # number of regressors of each of ``KINDS``
    mean: NDArray[np.float32]  # of the regressors [shape=(R,)]
    scale: NDArray[np.float32]  # their standard deviation [shape=(R,)]
    coefficients: NDArray[np.float32]  # [shape=(R, Q)]
    centre: Array  # mean of the motion [shape=(Q,)]
    variances: Array  # of the error of static value, Δ and Δ², in cross-validation [shape=(3, Q)]
    name: ClassVar[str] = "prior"
    ARRAYS: ClassVar[Mapping[str, ArraySpec]] = {
        "prior_sizes": ArraySpec(np.int32, str(len(KINDS)), 0, 1e5),
        "prior_inputs": ArraySpec(np.float32, "2 R", -1e6, 1e6),
        "prior_coefficients": ArraySpec(np.float32, "R Q", -1e4, 1e4),
        "prior_centre": ArraySpec(np.float64, "Q", -1e6, 1e6),
        "prior_variances": ArraySpec(np.float64, "3 Q", POSITIVE),
    }
    uses_prior: ClassVar[bool] = True
    uses_articulation: ClassVar[bool] = True

    @classmethod
    def fit(cls, training: PredictorTraining) -> PredictorFit:
        """Return the regression, and its predictions for each example by regressions on the other folds.

        Ridge parameters are chosen by cross-validation over examples, for the channels that are modelled as they are,
        one kind of regressors after the other. With a single example, the predictions are those of the regression
        itself.
        """
        examples, values = training.examples, training.values
        kinds = [_regressors(example.speech) for example in examples]
        sizes = tuple(kind.shape[1] for kind in kinds[0])
        everything = [np.concatenate(kind, axis=1) for kind in kinds]
        known = [example.valid[::STEP] for example in examples]
        rows = np.concatenate([x[mask] for x, mask in zip(everything, known, strict=True)])
        mean, scale = rows.mean(axis=0), rows.std(axis=0) + MIN_DEVIATION
        if sizes[-1]:  # principal components keep their proportions
            scale[-sizes[-1] :] = scale[-sizes[-1] :].max()
        measured = zip(everything, values, known, strict=True)
        data = [((x[mask] - mean) / scale, motion[::STEP][mask]) for x, motion, mask in measured]
        spread = np.maximum(np.concatenate([motion for _, motion in data]).std(axis=0), 1e-6)
        penalty = np.repeat(_choose_ridges(data, sizes, (1 / spread**2)[: training.direct]), sizes)
        predictions: list[Array] = [np.zeros(0)] * len(data)
        for inside, outside in split_folds(len(data)):
            coefficients, centre = _solve([data[n] for n in inside], penalty)
            for number in outside:
                steps = (everything[number] - mean) / scale @ coefficients + centre
                predictions[number] = interpolate_steps(steps, len(values[number]))
        coefficients, centre = _solve(data, penalty)
        mean_32, scale_32, coefficients_32 = (x.astype(np.float32) for x in (mean, scale, coefficients))
        variances = measure_error_variances(training, predictions, spread)
        return PredictorFit(cls(sizes, mean_32, scale_32, coefficients_32, centre, variances), predictions)

    def can_predict(self, speech: Speech) -> bool:
        """Return whether speech has the output of another model, or the regression uses none."""
        return speech.prior is not None or not any(self.sizes[:2])

    def predict(self, speech: Speech) -> tuple[Array, Array]:
        """Return motion [shape=(T, Q)] and distortion, 0 to 1 [shape=(T,)]. Raises InputError: an unknown phone."""
        kinds = _regressors(speech)
        row, starts = self.mean.astype(float), np.cumsum([0, *self.sizes])
        result = np.tile(row, (len(kinds[0]), 1))  # what the training had and this speech has not has its mean
        for kind, start, size in zip(kinds, starts, self.sizes, strict=False):
            result[:, start : start + min(size, kind.shape[1])] = kind[:, :size]
        steps = ((result - self.mean) / self.scale @ self.coefficients).astype(float) + self.centre
        frames = len(speech.features.values)
        distortion = speech.prior.distortion if speech.prior is not None else np.zeros(len(steps))
        outputs = interpolate_steps(np.concatenate([steps, distortion[:, None]], axis=1), frames)
        return outputs[:, :-1], np.clip(outputs[:, -1], 0, 1)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Serialise the regression; the coefficients at half precision."""
        return {
            "prior_sizes": np.array(self.sizes, np.int32),
            "prior_inputs": np.stack([self.mean, self.scale]),
            "prior_coefficients": self.coefficients.astype(np.float16),
            "prior_centre": self.centre,
            "prior_variances": self.variances,
        }

    @classmethod
    def from_arrays(cls, arrays: Arrays, dimensions: int) -> PriorRegression:
        """Deserialise a regression; as ``Predictor.from_arrays``."""
        stored = check_arrays(arrays, cls.ARRAYS, Q=dimensions)
        sizes = tuple(stored["prior_sizes"].tolist())
        around = (2 * ENCODING_REACH + 1) * ENCODING_COMPONENTS
        known = {(len(ARTICULATORS), (2 * WINDOW + 1) * SPECTRUM_BANDS, size) for size in (0, around)}
        if sum(sizes) != stored.sizes["R"] or sizes[2:] not in known:
            raise ValueError(f"prior_sizes {sizes}, whose sum is not {stored.sizes['R']}, or of another version")
        mean, scale = stored["prior_inputs"]
        scale = check_scale(scale, "prior_inputs")
        return cls(sizes, mean, scale, stored["prior_coefficients"], stored["prior_centre"], stored["prior_variances"])


def _regressors(speech: Speech) -> list[Array]:
    """Return the regressors of each of ``KINDS`` in every time step of 40 ms [each shape=(ceil(T / 4), ...)]."""
    frames = len(speech.features.values)
    count = -(-frames // STEP)
    spectrum = speech.spectrum if speech.spectrum is not None else np.zeros((frames, SPECTRUM_BANDS))
    padded = np.concatenate([spectrum, np.repeat(spectrum[-1:], count * STEP - frames, axis=0)])
    bands = padded.reshape(count, STEP, SPECTRUM_BANDS).mean(axis=1)
    around = np.clip(np.arange(count)[:, None] + np.arange(-WINDOW, WINDOW + 1), 0, count - 1)
    table = trace_articulators(speech.units, frames)[::STEP]
    prior = speech.prior
    motion, hidden = (prior.articulators, prior.hidden) if prior is not None else (np.zeros((count, 0)),) * 2
    encoded = speech.encoding is not None
    encoding = stack_encoding(speech, ENCODING_REACH, ENCODING_COMPONENTS) if encoded else np.zeros((count, 0))
    kinds = motion, hidden, table, bands[around].reshape(count, -1), encoding
    return [np.asarray(x, float) for x in kinds]


def _solve(data: Sequence[Fold], penalty: Array) -> tuple[Array, Array]:
    """Return coefficients [shape=(R, Q)] and centre [shape=(Q,)] of a ridge regression with a penalty a regressor."""
    x, y = (np.concatenate(arrays) for arrays in zip(*data, strict=True))
    centre, shift = y.mean(axis=0), x.mean(axis=0)
    scaled = (x - shift) / np.sqrt(penalty)
    if len(x) < x.shape[1]:  # the dual form has fewer equations
        dual = np.linalg.solve(scaled @ scaled.T + np.eye(len(x)), y - centre)
        coefficients = scaled.T @ dual
    else:
        coefficients = np.linalg.solve(scaled.T @ scaled + np.eye(x.shape[1]), scaled.T @ (y - centre))
    coefficients = coefficients / np.sqrt(penalty)[:, None]
    return coefficients, centre - shift @ coefficients


def _choose_ridges(data: Sequence[Fold], sizes: Sequence[int], weights: Array) -> Array:
    """Return the ridge parameter of each kind of regressors with the least error, by ``weights`` of dimensions."""
    data = [(regressors, motion[:, : len(weights)]) for regressors, motion in data]
    ridges = np.full(len(sizes), INITIAL_RIDGE)

    def error(candidate: Array) -> float:
        total = 0.0
        for inside, outside in split_folds(len(data)):
            coefficients, centre = _solve([data[n] for n in inside], np.repeat(candidate, sizes))
            for number in outside:
                regressors, motion = data[number]
                missed = regressors @ coefficients + centre - motion
                total += float((np.square(missed) * weights).sum())
        return total

    for _ in range(ROUNDS):
        for kind, size in enumerate(sizes):
            if not size:
                continue
            candidates = [np.where(np.arange(len(sizes)) == kind, ridge, ridges) for ridge in RIDGES]
            ridges = min(candidates, key=error)
    return ridges
