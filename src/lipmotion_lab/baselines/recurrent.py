"""A small recurrent network from acoustic features to motion, as a baseline. It needs the extra ``network``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import MissingDependencyError
from lipmotion.extensions import install_command
from lipmotion.types import Monitor, with_progress
from lipmotion_lab.baselines.frame_regression import Array, Baseline, Float32Array

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
    """Two bidirectional layers of 192 long short-term memory cells and a linear layer; least squared error.

    seed : of the initial weights, of the order of recordings, and of dropout
    """

    seed: int = 0

    def fit_map(  # noqa: D102
        self,
        features: Sequence[Float32Array],
        values: Sequence[Array],
        valid: Sequence[NDArray[np.bool_]],
        monitor: Monitor,
    ) -> TrainedNetwork:
        torch = import_torch()
        torch.manual_seed(self.seed)
        everything = np.concatenate([x[mask] for x, mask in zip(values, valid, strict=True)])
        mean, deviation = everything.mean(axis=0), np.maximum(everything.std(axis=0), 1e-6)
        sequences = [
            (_stacked(f), _every_fourth(((x - mean) / deviation).astype(np.float32)), _every_fourth(mask))
            for f, x, mask in zip(features, values, valid, strict=True)
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
