"""Baselines that regress motion on acoustic features frame by frame, without a model of phones."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines import Animator, Fit
from lipmotion.errors import MissingDependencyError
from lipmotion.extensions import install_command
from lipmotion.motion.space import MotionSpace, fit_reduced_motion
from lipmotion.stats.trees import ridge, zero_statistics
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.types import (
    FRAME_RATE_HZ,
    Constraints,
    Example,
    Generation,
    Monitor,
    Motion,
    Speech,
    StateTrace,
    with_progress,
)

Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]
Recording = tuple[Float32Array, Array, NDArray[np.bool_]]
"""Features, reduced motion, and which frames are valid [shape=(T, 39), (T, Q), (T,)]."""
COMPONENTS = 16
"""Dimensions that all point channels are reduced to, as in the engines."""
REACH = 15
"""Frames of acoustic context on both sides: ±150 ms."""
RIDGE_FRAMES = 1e-3
"""Strength of the ridge penalty, in frames of training."""


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
        given = [(np.asarray(example.speech.features.values), np.asarray(example.valid)) for example in examples]
        recordings = [(f, x, v) for (f, v), x in zip(given, values, strict=True)]
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
        predicted = self.predict(model.learned, np.asarray(speech.features.values))
        values, variance = model.space.restore(predicted, np.broadcast_to(model.variance, predicted.shape))
        motion = Motion(values, FRAME_RATE_HZ, model.space.channels)
        return Generation(motion, variance, speech.units, StateTrace(("all",), np.zeros(len(values), np.intp)))

    @abstractmethod
    def fit_map(self, recordings: Sequence[Recording], monitor: Monitor) -> Any:
        """Return a map from features to reduced motion, from the valid frames of recordings."""

    @abstractmethod
    def predict(self, learned: Any, features: Float32Array) -> Array:
        """Return the reduced motion [shape=(T, Q)] of features [shape=(T, 39)]."""


class LinearBaseline(Baseline):
    """Ridge regression of motion on the ``regressors`` of each frame."""

    strength: ClassVar[float] = 0.0

    @abstractmethod
    def regressors(self, features: Float32Array) -> Array:
        """Return the regressors of each frame [shape=(T, F)]."""

    def fit_map(self, recordings: Sequence[Recording], monitor: Monitor) -> Array:  # noqa: D102, ARG002 - takes seconds
        statistics, frames = None, 0
        for inputs, targets, mask in recordings:
            rows = self.regressors(inputs)[mask]
            statistics = statistics or zero_statistics(rows.shape[1], targets.shape[1])
            statistics.add(rows, targets[mask])
            frames += len(rows)
        if statistics is None:
            return np.zeros((0, 0))
        return ridge(statistics, np.zeros_like(statistics.targets), self.strength * frames)

    def predict(self, learned: Array, features: Float32Array) -> Array:  # noqa: D102
        return self.regressors(features) @ learned


@final
class MeanPose(LinearBaseline):
    """The mean of all training frames, for every frame."""

    def regressors(self, features: Float32Array) -> Array:  # noqa: D102
        return np.ones((len(features), 1))


@final
class ContextRidge(LinearBaseline):
    """Ridge regression on the features of all frames within ±150 ms."""

    strength = RIDGE_FRAMES

    def regressors(self, features: Float32Array) -> Array:  # noqa: D102
        frames = np.clip(np.arange(len(features))[:, None] + np.arange(-REACH, REACH + 1), 0, len(features) - 1)
        rows = features[frames].reshape(len(features), -1)
        return np.concatenate([rows, np.ones((len(rows), 1), rows.dtype)], axis=1).astype(float)


UNITS, LAYERS = 192, 2
STACKED_FRAMES = 4
"""Frames of features in one time step of the network: its steps are as far apart as the pictures of a video."""
EPOCHS, BATCH_SIZE, LEARNING_RATE = 40, 8, 4e-3
DROPOUT = 0.3
LEAST_STEPS = 600
"""Least number of optimiser steps: with few recordings there are more epochs."""


@dataclass(frozen=True, eq=False)
class TrainedNetwork:
    """A network, and the mean and standard deviation of its training targets [each shape=(Q,)]."""

    network: Any
    mean: Array
    deviation: Array


@final
@dataclass(frozen=True)
class BlstmBaseline(Baseline):
    """Two bidirectional layers of 192 LSTM cells and a linear layer, for least squared error."""

    seed: int = 0

    def fit_map(self, recordings: Sequence[Recording], monitor: Monitor) -> TrainedNetwork:  # noqa: D102
        torch = import_torch()
        torch.manual_seed(self.seed)
        everything = np.concatenate([x[mask] for _, x, mask in recordings])
        mean, deviation = everything.mean(axis=0), np.maximum(everything.std(axis=0), 1e-6)
        sequences = [
            (_stacked(f), _every_fourth(((x - mean) / deviation).astype(np.float32)), _every_fourth(mask))
            for f, x, mask in recordings
        ]
        network = _network(torch, sequences[0][0].shape[1], everything.shape[1])
        epochs = max(EPOCHS, -(-LEAST_STEPS * BATCH_SIZE // len(sequences)))
        optimiser = torch.optim.Adam(network.parameters(), lr=LEARNING_RATE)
        steps = epochs * -(-len(sequences) // BATCH_SIZE)
        schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, LEARNING_RATE, total_steps=steps)
        order = np.random.default_rng(self.seed)
        for _ in with_progress(range(epochs), "training the network", monitor):
            mixed = order.permutation(len(sequences))
            for start in range(0, len(mixed), BATCH_SIZE):
                _step(torch, network, optimiser, [sequences[i] for i in mixed[start : start + BATCH_SIZE]])
                schedule.step()
        return TrainedNetwork(network.eval(), mean, deviation)

    def predict(self, learned: TrainedNetwork, features: Float32Array) -> Array:  # noqa: D102
        torch = import_torch()
        with torch.no_grad():
            steps = learned.network(torch.from_numpy(_stacked(features))[None])[0].numpy().astype(float)
        positions = np.arange(len(features)) / STACKED_FRAMES
        curves = [np.interp(positions, np.arange(len(steps)), step) for step in steps.T]
        return np.stack(curves, axis=1) * learned.deviation + learned.mean


def import_torch() -> Any:
    """Return the module ``torch``. Raises MissingDependencyError."""
    try:
        import torch
    except ImportError as error:
        raise MissingDependencyError(
            f"the network needs PyTorch, which cannot be imported ({error}); {install_command('network')}"
        ) from error
    torch.set_num_threads(1)  # as all other systems: results do not depend on the number of cores
    return torch


def _network(torch: Any, inputs: int, outputs: int) -> Any:
    class Network(torch.nn.Module):  # type: ignore[misc] # torch is not there when types are checked
        def __init__(self) -> None:
            super().__init__()
            both = {"batch_first": True, "bidirectional": True, "dropout": DROPOUT}
            self.memory = torch.nn.LSTM(inputs, UNITS, LAYERS, **both)
            self.drop = torch.nn.Dropout(DROPOUT)
            self.line = torch.nn.Linear(2 * UNITS, outputs)

        def forward(self, features: Any) -> Any:
            return self.line(self.drop(self.memory(features)[0]))

    return Network()


def _step(
    torch: Any, network: Any, optimiser: Any, batch: Sequence[tuple[Float32Array, Float32Array, NDArray[np.bool_]]]
) -> None:
    """Take one optimiser step on a batch of recordings; the shorter ones are padded, and padding does not count."""
    columns = zip(*batch, strict=True)
    features, targets, valid = (
        torch.nn.utils.rnn.pad_sequence([torch.from_numpy(array) for array in column], batch_first=True)
        for column in columns
    )
    error = torch.square(network(features) - targets)[valid].mean()
    optimiser.zero_grad()
    error.backward()
    torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
    optimiser.step()


def _stacked(features: Float32Array) -> Float32Array:
    """Return each fourth frame with its neighbours, side by side [shape=(ceil(T / 4), 4·39)]."""
    centres = np.arange(0, len(features), STACKED_FRAMES)
    frames = np.clip(centres[:, None] + np.arange(STACKED_FRAMES) - STACKED_FRAMES // 2, 0, len(features) - 1)
    return np.ascontiguousarray(features[frames].reshape(len(centres), -1), np.float32)


def _every_fourth(values: NDArray[Any]) -> NDArray[Any]:
    return np.ascontiguousarray(values[::STACKED_FRAMES])
