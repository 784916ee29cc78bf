"""Posterior networks: motion from the posteriors of a phone recogniser, and from the spectrum of a voice that is known.

Posteriors are much the same for every speaker. Spectra tell more, but of the voices of the training alone: in a part of
the training of the convolutional network they are switched off, so that it serves every voice. The recurrent network
beside it serves those that are known.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import CorpusError, InputError
from lipmotion.motion.articulation import count_unseen
from lipmotion.motion.network_steps import (
    MIN_DEVIATION,
    STEP,
    check_scale,
    cut_random_piece,
    interpolate_steps,
    measure_error_variances,
    measure_poses,
    shape_convolutional,
    shape_recurrent,
    stack_spectrum,
)
from lipmotion.motion.predictors import Predictor, PredictorFit, PredictorTraining
from lipmotion.stats.network_training import SequenceNetwork, TrainingPlan, TrainingSequence
from lipmotion.stats.networks import ConvolutionalNetwork, RecurrentNetwork
from lipmotion.storage.schema import LARGEST_MEAN, POSITIVE, Arrays, ArraySpec, check_arrays
from lipmotion.types import FRAME_RATE_HZ, SPECTRUM_BANDS, Example, Speech, TokenPosteriors

Array = NDArray[np.float64]
Shifted = Sequence[Sequence[TrainingSequence]]  # each example from each of ``SHIFTS`` on
ROWS = 2  # rows of posteriors, of 20 ms each, in a time step of the network
ROW_FRAMES = STEP // ROWS
COMPONENTS = 120
"""Principal components of the logarithms of the posteriors: what the network says of phones that are not there tells
more than the phone that is."""
MIN_LOG_POSTERIOR = -12.0  # smaller logarithms count as this: the network does not mean them
INPUT_SCALE = 2.0
"""Standard deviation of the first principal component as input; the others keep their proportions to it."""
SPECTRUM = STEP * SPECTRUM_BANDS  # the first inputs of a time step: the spectrum
SPECTRUM_OFF = 0.3  # share of the training in which the spectrum is switched off (0)
SHAPE = shape_convolutional("posterior", "posterior-network", SPECTRUM + ROWS * COMPONENTS, 128, (1, 2, 4, 8, 1, 2, 4))
"""Its input is 0.88 s before and after a frame."""
SHIFTS = 2
"""Time steps begin at so many rows of posteriors: training draws one of them, the motion is the mean over all."""
BATCH_SIZE, LEARNING_RATE, DROPOUT, SEED = 16, 2e-3, 0.4, 0
STEPS, RECURRENT_STEPS = 50.0, 50.0
"""Optimiser steps of either network by the square root of the seconds of motion: 390 for 1 minute, 1,800 for 22."""
RECURRENT = shape_recurrent("recurrent", "recurrent-network", SHAPE.inputs, 96, 2)
RECURRENT_BATCH, RECURRENT_DROPOUT = 8, 0.5
RECURRENT_RATE, LARGEST_RECURRENT_RATE = 0.36, 3e-2
"""Learning rate, by one over the square root of the seconds of motion, and the largest one: large steps keep a network
of little speech from learning it by heart (docs/results/learning-curve.md)."""
RECURRENT_SHARE = 0.6  # weight of the recurrent network beside the convolutional one, for a voice that training knows
LARGEST_COMPONENT = 100.0  # more is in no basis

TARGETS = {
    "posterior_mean": ArraySpec(np.float32, "K", -LARGEST_MEAN, LARGEST_MEAN),
    "posterior_basis": ArraySpec(np.float32, f"K {COMPONENTS}", -LARGEST_COMPONENT, LARGEST_COMPONENT),
    "posterior_targets": ArraySpec(np.float64, "2 Q", -1e6, 1e6),
    "posterior_variances": ArraySpec(np.float64, "3 Q", POSITIVE),
    "posterior_source": ArraySpec(np.str_, "1"),
}


@final
@dataclass(frozen=True, eq=False)
class PosteriorNetwork(Predictor):
    """A network from posteriors and spectra to motion."""

    network: ConvolutionalNetwork  # its outputs are Q standardised dimensions of motion
    mean: NDArray[np.float32]  # of the logarithms of the posteriors [shape=(K,)]
    basis: NDArray[np.float32]  # from them to the inputs [shape=(K, 120)]
    centre: Array  # mean of the motion in training [shape=(Q,)]
    scale: Array  # its standard deviation [shape=(Q,)]
    variances: Array  # of the error of static value, Δ and Δ² in training [shape=(3, Q)]
    source: str  # name, version and digest of the phone recogniser (``TokenPosteriors.source``)
    recurrent: RecurrentNetwork | None = None  # for known voices; None: an example had no spectrum
    name: ClassVar[str] = "posteriors"
    needs: ClassVar[str] = "posteriors"
    ARRAYS: ClassVar[Mapping[str, ArraySpec]] = SHAPE.specs | TARGETS | RECURRENT.specs

    @classmethod
    def conditions(cls, motion_s: float, most: int) -> int:  # noqa: ARG003
        """Return 1: the network is trained on recordings as they are; 0 where spectra are not wanted."""
        return min(most, 1)

    @classmethod
    def fit(cls, training: PredictorTraining) -> PredictorFit:
        """Return a network trained on examples as recorded, with spectra if all have them. Raises CorpusError."""
        examples = training.examples
        posteriors = list_posteriors(examples)
        if posteriors is None:
            raise CorpusError("examples without posteriors, which this predictor needs; train with the recogniser auto")
        centre, scale = measure_poses(training)
        rows = [limit_logarithms(each) for each in posteriors]
        mean, basis = fit_components(rows)
        heard = all(example.condition_spectra for example in examples)
        spectra = [example.condition_spectra[0].values if heard else None for example in examples]
        inputs = [_stack_inputs((row - mean) @ basis, x) for row, x in zip(rows, spectra, strict=True)]
        sequences = [
            [_make_sequence(steps, (x - centre) / scale, example.valid, shift) for shift, steps in enumerate(shifted)]
            for shifted, x, example in zip(inputs, training.values, examples, strict=True)
        ]
        motion_s = sum(int(example.valid.sum()) for example in examples) / FRAME_RATE_HZ
        network = _train_convolutional(training, sequences, motion_s)
        recurrent = _train_recurrent(training, sequences, motion_s) if heard else None
        predicted = (
            _run(network, shifted, len(values)) * scale + centre
            for shifted, values in zip(inputs, training.values, strict=True)
        )
        variances = measure_error_variances(training, predicted, scale)
        return PredictorFit(cls(network, mean, basis, centre, scale, variances, posteriors[0].source, recurrent))

    def predict(self, speech: Speech) -> tuple[Array, Array]:
        """Return motion in the motion space [shape=(T, Q)], and no distortion: 0 [shape=(T,)].

        The spectrum counts as far as training knows the voice.
        Raises InputError: speech without posteriors, or with those of another phone recogniser than in training.
        """
        frames = len(speech.features.values)
        share = 0.0 if speech.spectrum is None else 1 - count_unseen(speech.voice)
        motion = np.zeros((frames, len(self.centre)))
        for spectrum, weight in ((None, 1 - share), (speech.spectrum, share)):
            if weight > 0:
                motion += weight * speech.cached((self, spectrum is None), partial(self._predict, speech, spectrum))
        return motion, np.zeros(frames)

    def hidden_units(self, posteriors: TokenPosteriors, steps: int) -> NDArray[np.float32]:
        """Return the last hidden layer, without spectrum [shape=(steps, H)]. Raises InputError: as ``predict``."""
        rows = self.network.hidden(_stack_shift(self._components(posteriors), None, 0))
        return rows[np.minimum(np.arange(steps), len(rows) - 1)]

    def _predict(self, speech: Speech, spectrum: NDArray[np.floating] | None) -> Array:
        """Return motion in the motion space [shape=(T, Q)], with the spectrum or without."""
        shifted, frames = _stack_inputs(self._components(speech.posteriors), spectrum), len(speech.features.values)
        outputs = _run(self.network, shifted, frames)
        if self.recurrent is not None and spectrum is not None:
            outputs += RECURRENT_SHARE * (_run(self.recurrent, shifted, frames) - outputs)
        return outputs * self.scale + self.centre

    def _components(self, posteriors: TokenPosteriors | None) -> NDArray[np.floating]:
        """Return the principal components of the logarithms of posteriors [shape=(N, 120)]; raise as ``predict``."""
        if posteriors is None:
            raise InputError("the speech has no posteriors; an engine that uses them says so by ``inputs``")
        if posteriors.source != self.source:
            what = f"the model was trained with the phone recogniser {self.source}, this one is {posteriors.source};"
            package = "==".join(self.source.split()[:2])
            raise InputError(f"{what} install that one (pip install {package}), or use the recogniser fast")
        return (limit_logarithms(posteriors) - self.mean) @ self.basis

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Serialise the networks, at half precision."""
        arrays = SHAPE.arrays(self.network) | {"posterior_mean": self.mean, "posterior_basis": self.basis}
        arrays |= RECURRENT.arrays(self.recurrent) if self.recurrent is not None else {}
        return {name: array.astype(np.float16) for name, array in arrays.items()} | {
            "posterior_targets": np.stack([self.centre, self.scale]),
            "posterior_variances": self.variances,
            "posterior_source": np.array([self.source]),
        }

    @classmethod
    def from_arrays(cls, arrays: Arrays, dimensions: int) -> PosteriorNetwork:
        """Deserialise a network; as ``Predictor.from_arrays``."""
        stored = check_arrays(arrays, TARGETS, Q=dimensions)
        centre, scale = stored["posterior_targets"]
        scale, network = check_scale(scale, "posterior_targets"), SHAPE.from_arrays(arrays, dimensions)
        mean, basis, variances = (stored[f"posterior_{name}"] for name in ("mean", "basis", "variances"))
        is_alone = arrays.keys().isdisjoint(RECURRENT.specs)
        recurrent = None if is_alone else RECURRENT.from_arrays(arrays, dimensions)
        return cls(network, mean, basis, centre, scale, variances, str(stored["posterior_source"][0]), recurrent)


def list_posteriors(examples: Sequence[Example]) -> list[TokenPosteriors] | None:
    """Return the posteriors of examples; None where one of them has none."""
    known = [example.speech.posteriors for example in examples if example.speech.posteriors is not None]
    return known if known and len(known) == len(examples) else None


def _train_convolutional(training: PredictorTraining, sequences: Shifted, motion_s: float) -> ConvolutionalNetwork:
    def draw(rng: np.random.Generator, number: int) -> TrainingSequence:
        piece = _draw_piece(sequences, rng, number)
        if rng.random() >= SPECTRUM_OFF:
            return piece
        rows = piece.inputs.copy()
        rows[:, :SPECTRUM] = 0
        return piece._replace(inputs=rows)

    steps = max(round(STEPS * math.sqrt(motion_s)), 1)
    plan = TrainingPlan(steps, min(BATCH_SIZE, len(sequences)), LEARNING_RATE, DROPOUT, SEED)
    return SHAPE.train(training, sequences[0][0].targets.shape[1], draw, plan)


def _train_recurrent(training: PredictorTraining, sequences: Shifted, motion_s: float) -> RecurrentNetwork:
    rate = min(RECURRENT_RATE / math.sqrt(motion_s), LARGEST_RECURRENT_RATE)
    steps = max(round(RECURRENT_STEPS * math.sqrt(motion_s)), 1)
    plan = TrainingPlan(steps, min(RECURRENT_BATCH, len(sequences)), rate, RECURRENT_DROPOUT, SEED)
    return RECURRENT.train(training, sequences[0][0].targets.shape[1], partial(_draw_piece, sequences), plan)


def _draw_piece(sequences: Shifted, rng: np.random.Generator, number: int) -> TrainingSequence:
    shifted = sequences[number]
    return cut_random_piece(shifted[int(rng.integers(len(shifted)))], rng)


def _make_sequence(rows: NDArray[np.float32], targets: Array, valid: NDArray[np.bool_], shift: int) -> TrainingSequence:
    """Return inputs of time steps [shape=(N, 400)] with their targets, which are given by frame [shape=(T, Q)]."""
    frames = np.minimum(np.arange(len(rows)) * STEP + shift * ROW_FRAMES, len(targets) - 1)
    return TrainingSequence(rows, targets[frames].astype(np.float32), valid[frames])


def _run(network: SequenceNetwork, shifted: Sequence[NDArray[np.float32]], frames: int) -> Array:
    """Return the outputs of a network, the mean over all shifts of its inputs [shape=(frames, Q)]."""
    outputs = [interpolate_steps(network(x).astype(float), frames, s * ROW_FRAMES) for s, x in enumerate(shifted)]
    mean: Array = np.mean(outputs, axis=0)
    return mean


def fit_components(rows: Sequence[NDArray[np.float32]]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the mean of posteriors [shape=(K,)] and a basis, scaled as inputs of the network [shape=(K, 120)]."""
    everything = np.concatenate(rows).astype(float)
    mean = everything.mean(axis=0)
    values, vectors = np.linalg.eigh(np.cov(everything - mean, rowvar=False))
    chosen = vectors[:, ::-1][:, :COMPONENTS]
    basis = np.zeros((len(mean), COMPONENTS))
    basis[:, : chosen.shape[1]] = chosen * (INPUT_SCALE / max(float(np.sqrt(values[-1])), MIN_DEVIATION))
    return mean.astype(np.float32), basis.astype(np.float32)


def limit_logarithms(posteriors: TokenPosteriors) -> NDArray[np.float32]:
    """Return the logarithms of posteriors within the limit [shape=(N, K)]."""
    limited: NDArray[np.float32] = np.maximum(posteriors.values, MIN_LOG_POSTERIOR).astype(np.float32)
    return limited


def _stack_inputs(components: NDArray[np.floating], spectrum: NDArray[np.floating] | None) -> list[NDArray[np.float32]]:
    """Return the inputs in every time step, by shift: the spectrum (None: off), then the components of two rows."""
    return [_stack_shift(components, spectrum, shift) for shift in range(min(SHIFTS, len(components)))]


def _stack_shift(
    components: NDArray[np.floating], spectrum: NDArray[np.floating] | None, shift: int
) -> NDArray[np.float32]:
    """Return the inputs in every time step, of which the first begins at a row of posteriors."""
    rows = components[shift:]
    filled = np.concatenate([rows, np.repeat(rows[-1:], len(rows) % ROWS, axis=0)])
    result = np.zeros((len(filled) // ROWS, SHAPE.inputs), np.float32)
    result[:, SPECTRUM:] = filled.reshape(len(result), -1)
    if spectrum is not None:
        steps = stack_spectrum(spectrum[min(shift * ROW_FRAMES, len(spectrum) - 1) :])
        result[:, :SPECTRUM] = steps[np.minimum(np.arange(len(result)), len(steps) - 1)]
    return result
