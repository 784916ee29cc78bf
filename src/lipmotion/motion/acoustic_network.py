"""Acoustic networks: the motion, and the distortion of the sound, from spectrum and encoding around each frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import CorpusError, InputError
from lipmotion.motion.articulation import count_unseen
from lipmotion.motion.network_steps import (
    ENCODING_SCALE,
    STEP,
    check_scale,
    cut_random_piece,
    interpolate_steps,
    measure_error_variances,
    measure_poses,
    shape_convolutional,
    stack_spectrum,
)
from lipmotion.motion.posterior_network import PosteriorNetwork, list_posteriors
from lipmotion.motion.predictors import Predictor, PredictorFit, PredictorTraining
from lipmotion.motion.prior_regression import COMPONENTS, EncodingRegression
from lipmotion.stats.network_training import TrainingPlan, TrainingSequence
from lipmotion.stats.networks import TAPS, ConvolutionalNetwork
from lipmotion.storage.schema import POSITIVE, Arrays, ArraySpec, check_arrays
from lipmotion.types import SPECTRUM_BANDS, Speech, sub_monitor

Array = NDArray[np.float64]
ENCODED_FRAMES = 2  # frames from one row of the encoding that is used to the next
FORMER_SHAPE, SHAPE = (
    shape_convolutional("network", "network", STEP * SPECTRUM_BANDS + encoded, 192, (1, 2, 4, 8, 1, 2, 4, 8))
    for encoded in (0, STEP // ENCODED_FRAMES * COMPONENTS)
)
"""The network without the encoding, in former models, and that of now: 1.2 s before and after a frame."""
BATCH_SIZE, LEARNING_RATE, DROPOUT, SEED = 16, 2e-3, 0.3, 0
MIN_STEPS = 600  # smallest number of optimiser steps: with few recordings, each is used more often
MIN_MOTION_S = 120.0  # seconds of measured motion from which on a network is trained
POSTERIOR_SHARES = (0.85, 1.0)
"""Share of the network that knows posteriors, for a voice that training knows and for one that it does not. It is
trained on clean speech, the other one in noise and rooms."""
SURE_POSTERIORS, LESS_SURE = (0.75, 0.9), 0.15
"""It has no share at the first mean posterior, all of its share at the second; where nothing is known of the voice, at
so much less: the other network knows one voice alone."""
ENCODING_SHARE = 0.5
"""Share of the regression on the encoding for a voice that training knows half or less; one that it knows has none. As
it is trained in quiet, it has it where the posteriors are sure."""

TARGETS = {
    "network_targets": ArraySpec(np.float64, "2 Q", -1e6, 1e6),
    "network_variances": ArraySpec(np.float64, "3 Q", POSITIVE),
}


@final
@dataclass(frozen=True, eq=False)
class AcousticNetwork(Predictor):
    """A network from sound to motion in noise and rooms, and one beside it that knows posteriors of phones."""

    network: ConvolutionalNetwork  # its outputs are Q standardised dimensions of motion, and the distortion
    mean: Array  # of the motion in training [shape=(Q,)]
    scale: Array  # its standard deviation [shape=(Q,)]
    variances: Array  # of the error of static value, Δ and Δ² in training [shape=(3, Q)]
    posterior_network: PosteriorNetwork | None = None  # None: no phone recogniser was installed in training
    encoding: EncodingRegression | None = None  # for other voices; None: training had no encodings
    name: ClassVar[str] = "network"
    needs: ClassVar[str] = "spectrum"
    ARRAYS: ClassVar[Mapping[str, ArraySpec]] = SHAPE.specs | TARGETS
    CONTAINS: ClassVar[frozenset[str]] = frozenset({PosteriorNetwork.name, EncodingRegression.name})

    @classmethod
    def conditions(cls, motion_s: float, most: int) -> int:
        """Return all conditions, or 0 with too little motion for a network."""
        return most if motion_s >= MIN_MOTION_S else 0

    @classmethod
    def fit(cls, training: PredictorTraining) -> PredictorFit:
        """Return a network that is trained on all acoustic conditions of each example.

        Each example is used in one of its conditions, drawn at random, at a time.
        Raises CorpusError: an example without acoustic conditions or encoding.
        """
        examples = training.examples
        if not all(example.condition_spectra for example in examples):
            required = f"{MIN_MOTION_S:g} s of measured motion or more, and the option conditions from 1"
            raise CorpusError(f"examples without acoustic conditions; a network needs {required}")
        mean, scale = measure_poses(training)
        network = _train(replace(training, monitor=sub_monitor(training.monitor, 0, 0.8)), mean, scale)
        trained = cls(network, mean, scale, np.ones((3, len(mean))))
        recorded = (example.condition_spectra[0] for example in examples)
        predicted = (trained._predict(_stack(each.values, each.encoding), len(each.values))[0] for each in recorded)
        variances = measure_error_variances(training, predicted, scale)
        last = replace(training, monitor=sub_monitor(training.monitor, 0.8, 1))
        posterior_network: Any = PosteriorNetwork.fit(last).predictor if list_posteriors(examples) else None
        encoding: Any = EncodingRegression.fit(training).predictor
        return PredictorFit(cls(network, mean, scale, variances, posterior_network, encoding))

    def predict(self, speech: Speech) -> tuple[Array, Array]:
        """Return motion [shape=(T, Q)] and distortion, 0 to 1 [shape=(T,)]. Raises InputError: no sound in it."""
        inputs = self._find_inputs(speech)
        if inputs is None:
            raise InputError("the speech has no spectrum or encoding; an engine that uses them says so by ``inputs``")
        motion, distortion = speech.cached(self, lambda: self._predict(inputs, len(speech.features.values)))
        network, posteriors, strange = self.posterior_network, speech.posteriors, count_unseen(speech.voice)
        if network is not None and posteriors is not None:
            share = _rate_sureness(speech, LESS_SURE * strange**4) * np.interp(strange, (0, 1), POSTERIOR_SHARES)
            motion = motion + share * (network.predict(speech)[0] - motion)
        if self.encoding is not None and speech.encoding is not None and strange:
            applies = min(2 * strange, 1.0) * _rate_sureness(speech)
            motion = motion + ENCODING_SHARE * applies * (self.encoding.predict(speech)[0] - motion)
        return motion, distortion

    def _find_inputs(self, speech: Speech) -> NDArray[np.float32] | None:
        if speech.spectrum is None or len(self.network.layers[0].weights) == TAPS * FORMER_SHAPE.inputs:
            return None if speech.spectrum is None else stack_spectrum(speech.spectrum)
        return None if speech.encoding is None else _stack(speech.spectrum, speech.encoding)

    def _predict(self, inputs: NDArray[np.float32], frames: int) -> tuple[Array, Array]:
        outputs = interpolate_steps(self.network(inputs).astype(float), frames)
        return outputs[:, :-1] * self.scale + self.mean, np.clip(outputs[:, -1], 0, 1)

    def hidden(self, speech: Speech) -> tuple[NDArray[np.float32], Array] | None:
        """Return the last hidden layer [shape=(ceil(T / 4), H)] and the distortion [shape=(ceil(T / 4),)] in each step.

        After the hidden units of the network come those of the one beside it, where the speech has posteriors.
        None: speech without a spectrum or encoding.
        """
        inputs = self._find_inputs(speech)
        if inputs is None:
            return None
        hidden = self.network.hidden(inputs)
        output = self.network.output
        distortion = np.clip(hidden @ output.weights[:, -1].astype(float) + output.biases[-1], 0, 1)
        if self.posterior_network is not None and speech.posteriors is not None:
            inner = self.posterior_network.hidden_units(speech.posteriors, len(hidden))
            hidden = np.concatenate([hidden, inner], axis=1)
        return hidden, distortion

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Serialise the network, at half precision."""
        stored = SHAPE.arrays(self.network)
        arrays: dict[str, NDArray[Any]] = {name: array.astype(np.float16) for name, array in stored.items()}
        arrays |= {"network_targets": np.stack([self.mean, self.scale]), "network_variances": self.variances}
        for part in (self.posterior_network, self.encoding):
            arrays |= part.arrays() if part is not None else {}
        return arrays

    @classmethod
    def from_arrays(cls, arrays: Arrays, dimensions: int) -> AcousticNetwork:
        """Deserialise a network; as ``Predictor.from_arrays``."""
        stored = check_arrays(arrays, TARGETS, Q=dimensions)
        mean, scale = stored["network_targets"]
        shape = SHAPE if len(arrays["network_first"]) == TAPS * SHAPE.inputs else FORMER_SHAPE
        network = shape.from_arrays(arrays, dimensions + 1)
        scale = check_scale(scale, "network_targets")
        kinds: tuple[Any, Any] = (PosteriorNetwork, EncodingRegression)
        inner = [None if arrays.keys().isdisjoint(k.ARRAYS) else k.from_arrays(arrays, dimensions) for k in kinds]
        return cls(network, mean, scale, stored["network_variances"], *inner)


def _stack(spectrum: NDArray[np.floating], encoding: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return spectrum and encoding around every time step [shape=(ceil(T / 4), 288)]."""
    steps = stack_spectrum(spectrum)
    rows = np.arange(0, STEP * len(steps), ENCODED_FRAMES)
    encoded = np.asarray(encoding)[np.minimum(rows, len(encoding) - 1)].astype(np.float32) * ENCODING_SCALE
    return np.concatenate([steps, encoded.reshape(len(steps), -1)], axis=1)


def _rate_sureness(speech: Speech, less: float = 0.0) -> float:
    """Return how sure the posteriors are, 0 to 1, where so much less is enough; 1 without posteriors."""
    mean = SURE_POSTERIORS[1] if speech.posteriors is None else speech.posteriors.mean
    return float(np.interp(mean + less, SURE_POSTERIORS, (0, 1)))


def _train(training: PredictorTraining, mean: Array, scale: Array) -> ConvolutionalNetwork:
    steps = max(training.epochs * -(-len(training.examples) // BATCH_SIZE), MIN_STEPS)

    @cache
    def versions_of(number: int) -> list[TrainingSequence]:  # whole, in time steps, inputs at half precision
        example, targets = training.examples[number], (training.values[number] - mean) / scale
        versions = []
        for version in example.condition_spectra:
            inputs = _stack(version.values, version.encoding).astype(np.float16)
            frames = np.minimum(np.round(np.arange(len(inputs)) * STEP * version.tempo).astype(int), len(targets) - 1)
            distortion = np.full((len(inputs), 1), version.distortion)
            outputs = np.concatenate([targets[frames], distortion], axis=1).astype(np.float32)
            versions.append(TrainingSequence(inputs, outputs, example.valid[frames]))
        return versions

    def draw(rng: np.random.Generator, number: int) -> TrainingSequence:
        versions = versions_of(number)
        return cut_random_piece(versions[int(rng.integers(len(versions)))], rng)

    return SHAPE.train(training, len(mean) + 1, draw, TrainingPlan(steps, BATCH_SIZE, LEARNING_RATE, DROPOUT, SEED))
