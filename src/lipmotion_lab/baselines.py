"""Baselines that regress motion on what is heard, without a model of phones."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines import Animator, Fit, Inputs
from lipmotion.motion.network_steps import STEP, cut_random_piece, interpolate_steps, stack_spectrum
from lipmotion.motion.posterior_network import ROWS, fit_components, limit_logarithms
from lipmotion.motion.space import MotionSpace, fit_reduced_motion
from lipmotion.stats.network_training import TrainingPlan, TrainingSequence, fit_network
from lipmotion.stats.networks import RecurrentNetwork, make_recurrent_network
from lipmotion.stats.trees import create_statistics, ridge
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.types import (
    FRAME_RATE_HZ,
    Constraints,
    Example,
    Generation,
    Monitor,
    Motion,
    Progress,
    Speech,
    StateTrace,
)

Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]
Recording = tuple[Speech, Array, NDArray[np.bool_]]
"""Speech, reduced motion, and which frames are valid [shape=(T, Q), (T,)]."""
COMPONENTS = 16  # dimensions that all point channels are reduced to, as in the engines
REACH = 15  # frames of acoustic context on both sides: ±150 ms
RIDGE_FRAMES = 1e-3  # strength of the ridge penalty, in frames of training


@dataclass(frozen=True, eq=False)
class FrameRegressionModel:
    """A map from the acoustic features of a frame and its neighbours to motion.

    space    : reduced space of the motion
    learned  : coefficients [shape=(F, Q)], or another representation that the baseline has trained
    variance : mean squared error in the reduced space [shape=(Q,)]
    """

    space: MotionSpace
    learned: Any
    variance: Array


class Baseline(Animator[FrameRegressionModel]):
    """Predicts reduced motion from acoustic features, without phones."""

    def fit(  # noqa: D102
        self,
        examples: Sequence[Example],
        monitor: Monitor,
        checkpoint: Checkpoint = NO_CHECKPOINT,  # noqa: ARG002 - it takes seconds
    ) -> Fit[FrameRegressionModel]:
        space, values = fit_reduced_motion(examples, COMPONENTS)
        recordings = [(each.speech, x, np.asarray(each.valid)) for each, x in zip(examples, values, strict=True)]
        learned = self.fit_map(recordings, monitor)
        errors = [np.square(self.predict(learned, f) - x)[v] for f, x, v in recordings]
        model = FrameRegressionModel(space, learned, np.concatenate(errors).mean(axis=0))
        return Fit(model, {"frames": sum(map(len, errors))})

    def generate(  # noqa: D102
        self,
        model: FrameRegressionModel,
        speech: Speech,
        constraints: Constraints | None = None,  # noqa: ARG002 - compared, never edited
    ) -> Generation:
        predicted = self.predict(model.learned, speech)
        values = model.space.restore(predicted)
        variance = np.broadcast_to(model.variance, predicted.shape) @ model.space.mixing
        motion = Motion(values, FRAME_RATE_HZ, model.space.channels)
        return Generation(motion, variance, speech.units, StateTrace(("all",), np.zeros(len(values), np.intp)))

    @abstractmethod
    def fit_map(self, recordings: Sequence[Recording], monitor: Monitor) -> Any:
        """Return a map from speech to reduced motion, from the valid frames of recordings."""

    @abstractmethod
    def predict(self, learned: Any, speech: Speech) -> Array:
        """Return the reduced motion of speech [shape=(T, Q)]."""


class ContextRidge(Baseline):
    """Ridge regression on the features of all frames within a reach, and a constant."""

    reach: ClassVar[int] = REACH
    strength: ClassVar[float] = RIDGE_FRAMES

    def fit_map(self, recordings: Sequence[Recording], monitor: Monitor) -> Array:  # noqa: D102, ARG002 - takes seconds
        statistics, frames = None, 0
        for speech, targets, mask in recordings:
            rows = self.stack_regressors(speech)[mask]
            statistics = statistics or create_statistics(rows.shape[1], targets.shape[1])
            statistics.add(rows, targets[mask])
            frames += len(rows)
        if statistics is None:
            return np.zeros((0, 0))
        return ridge(statistics, np.zeros_like(statistics.targets), self.strength * frames)

    def predict(self, learned: Array, speech: Speech) -> Array:  # noqa: D102
        return self.stack_regressors(speech) @ learned

    def stack_regressors(self, speech: Speech) -> Array:
        """Return the regressors of each frame [shape=(T, F)]."""
        features = np.asarray(speech.features.values)
        offsets = np.arange(-self.reach, self.reach + 1)
        frames = np.clip(np.arange(len(features))[:, None] + offsets, 0, len(features) - 1)
        rows = features[frames].reshape(len(features), len(offsets) * features.shape[1])
        return np.concatenate([rows, np.ones((len(rows), 1), rows.dtype)], axis=1).astype(float)


@final
class MeanPose(ContextRidge):
    """The mean of all training frames, for every frame: the constant alone."""

    reach, strength = -1, 0.0


LAYERS, BATCH_SIZE, DROPOUT = 2, 8, 0.4


@dataclass(frozen=True, eq=False)
class Hearing:
    """How a network hears speech: acoustic features, and posteriors and encoding where the training has them.

    mean, basis : of the logarithms of the posteriors, as of ``PosteriorNetwork`` (None: there are none)
    scale       : standard deviation of the encoding in training (None: it had none)
    """

    mean: Float32Array | None
    basis: Float32Array | None
    scale: float | None

    @classmethod
    def fit(cls, recordings: Sequence[Speech]) -> Hearing:
        """Return that of a training."""
        posteriors = [limit_logarithms(each.posteriors) for each in recordings if each.posteriors is not None]
        encodings = [np.asarray(each.encoding, np.float32) for each in recordings if each.encoding is not None]
        mean, basis = fit_components(posteriors) if len(posteriors) == len(recordings) else (None, None)
        scale = float(np.concatenate(encodings).std()) if len(encodings) == len(recordings) else None
        return cls(mean, basis, scale)

    def stack_steps(self, speech: Speech) -> Float32Array:
        """Return what the network hears in every time step of 40 ms [shape=(ceil(T / 4), I)]."""
        parts = [stack_spectrum(np.asarray(speech.features.values))]
        if self.mean is not None and self.basis is not None and speech.posteriors is not None:
            rows = (limit_logarithms(speech.posteriors) - self.mean) @ self.basis
            at = np.minimum(ROWS * np.arange(len(parts[0]))[:, None] + np.arange(ROWS), len(rows) - 1)
            parts.append(rows[at].reshape(len(at), -1))
        if self.scale is not None:
            parts.append(np.asarray(speech.encoding, np.float32)[::STEP] / self.scale)
        return np.concatenate(parts, axis=1, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class TrainedNetwork:
    """A network, how it hears, and the mean and standard deviation of its training targets [each shape=(Q,)]."""

    network: RecurrentNetwork
    hearing: Hearing
    mean: Array
    deviation: Array


@final
@dataclass(frozen=True)
class BlstmBaseline(Baseline):
    """Two bidirectional layers of LSTM cells and a linear layer, for least squared error.

    It hears what our engines hear: posteriors of the phone recogniser, where one is installed, and the encoding, too.

    rate, cells : learning rate; cells of a layer in either direction
    steps       : of the optimiser, by the square root of the seconds of motion, as of ``PosteriorNetwork``
    """

    rate: float = 4e-3
    cells: int = 96
    steps: float = 50.0
    seed: int = 0

    def inputs(self, motion_s: float = math.inf) -> Inputs:  # noqa: D102, ARG002
        return Inputs(posteriors=True, encoding=True)

    def fit_map(self, recordings: Sequence[Recording], monitor: Monitor) -> TrainedNetwork:  # noqa: D102
        everything = np.concatenate([x[mask] for _, x, mask in recordings])
        mean, deviation = everything.mean(axis=0), np.maximum(everything.std(axis=0), 1e-6)
        hearing = Hearing.fit([speech for speech, _, _ in recordings])
        sequences = [
            TrainingSequence(
                hearing.stack_steps(speech), ((x - mean) / deviation)[::STEP].astype(np.float32), mask[::STEP]
            )
            for speech, x, mask in recordings
        ]
        count, outputs = len(sequences), everything.shape[1]
        steps = max(round(self.steps * math.sqrt(len(everything) / FRAME_RATE_HZ)), 1)
        network = fit_network(
            make_recurrent_network(sequences[0].inputs.shape[1], self.cells, outputs, LAYERS, self.seed),
            lambda rng, number: cut_random_piece(sequences[number], rng),
            count,
            np.ones(outputs),
            TrainingPlan(steps, min(BATCH_SIZE, count), self.rate, DROPOUT, self.seed),
            lambda step, error: monitor(Progress("training the network", step, steps, step / steps, figure=error)),
        )
        return TrainedNetwork(network, hearing, mean, deviation)

    def predict(self, learned: TrainedNetwork, speech: Speech) -> Array:  # noqa: D102
        steps = learned.network(learned.hearing.stack_steps(speech)).astype(float)
        return interpolate_steps(steps, len(speech.features.values)) * learned.deviation + learned.mean
