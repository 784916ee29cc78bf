"""A small recurrent network from sound to motion, as a rival. Needs the extra ``network``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import MissingDependencyError
from lipmotion.experiments.baselines.regression import Array, Baseline, Single
from lipmotion.types import Monitor, counted

UNITS, LAYERS = 192, 2
STACKED = 4
"""Frames of sound in one step of the network: its steps are as far apart as a video's pictures."""
EPOCHS, AT_A_TIME, FASTEST = 40, 8, 4e-3
DROPOUT = 0.3
LEAST_STEPS = 600
"""Of learning: few recordings are gone through more often."""


def network_here() -> bool:
    """Return whether torch can be imported."""
    try:
        import_torch()
    except MissingDependencyError:
        return False
    return True


@dataclass(frozen=True, eq=False)
class Trained:
    """A network, and mean and deviation of what it was taught [each shape=(Q,)]."""

    network: Any
    mean: Array
    deviation: Array


@final
@dataclass(frozen=True)
class Blstm(Baseline):
    """Two layers of 192 long short-term memory cells in both directions, then a line; taught the least squared error.

    seed : of the first weights, of the order of recordings, and of what is dropped
    """

    seed: int = 0

    def learned(  # noqa: D102
        self, features: Sequence[Single], values: Sequence[Array], seen: Sequence[NDArray[np.bool_]], monitor: Monitor
    ) -> Trained:
        torch = import_torch()
        torch.manual_seed(self.seed)
        everything = np.concatenate([x[mask] for x, mask in zip(values, seen, strict=True)])
        mean, deviation = everything.mean(axis=0), np.maximum(everything.std(axis=0), 1e-6)
        lessons = [
            (_stacked(f), _every(((x - mean) / deviation).astype(np.float32)), _every(mask))
            for f, x, mask in zip(features, values, seen, strict=True)
        ]
        network = _network(torch, lessons[0][0].shape[1], everything.shape[1])
        epochs = max(EPOCHS, -(-LEAST_STEPS * AT_A_TIME // len(lessons)))
        optimiser = torch.optim.Adam(network.parameters(), lr=FASTEST)
        steps = epochs * -(-len(lessons) // AT_A_TIME)
        pace = torch.optim.lr_scheduler.OneCycleLR(optimiser, FASTEST, total_steps=steps)
        order = np.random.default_rng(self.seed)
        for _ in counted(range(epochs), "teaching the network", monitor):
            mixed = order.permutation(len(lessons))
            for start in range(0, len(mixed), AT_A_TIME):
                _step(torch, network, optimiser, [lessons[i] for i in mixed[start : start + AT_A_TIME]])
                pace.step()
        return Trained(network.eval(), mean, deviation)

    def mapped(self, learned: Trained, features: Single) -> Array:  # noqa: D102
        torch = import_torch()
        with torch.no_grad():
            steps = learned.network(torch.from_numpy(_stacked(features))[None])[0].numpy().astype(float)
        places = np.arange(len(features)) / STACKED
        curves = [np.interp(places, np.arange(len(steps)), step) for step in steps.T]
        return np.stack(curves, axis=1) * learned.deviation + learned.mean


def import_torch() -> Any:
    """Return the module ``torch``. Raises MissingDependencyError."""
    try:
        import torch
    except ImportError as error:
        raise MissingDependencyError(
            f'the network needs PyTorch, which cannot be imported ({error}); pip install "lipmotion[network]"'
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

        def forward(self, heard: Any) -> Any:
            return self.line(self.drop(self.memory(heard)[0]))

    return Network()


def _step(
    torch: Any, network: Any, optimiser: Any, lessons: Sequence[tuple[Single, Single, NDArray[np.bool_]]]
) -> None:
    """Learn from some recordings, the shorter ones filled up with what does not count."""
    columns = zip(*lessons, strict=True)
    heard, wanted, counts = (
        torch.nn.utils.rnn.pad_sequence([torch.from_numpy(one) for one in column], batch_first=True)
        for column in columns
    )
    error = torch.square(network(heard) - wanted)[counts].mean()
    optimiser.zero_grad()
    error.backward()
    torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
    optimiser.step()


def _stacked(features: Single) -> Single:
    """Return the frames around every fourth one side by side [shape=(ceil(T / 4), 4·39)]."""
    centres = np.arange(0, len(features), STACKED)
    frames = np.clip(centres[:, None] + np.arange(STACKED) - STACKED // 2, 0, len(features) - 1)
    return np.ascontiguousarray(features[frames].reshape(len(centres), -1), np.float32)


def _every(values: NDArray[Any]) -> NDArray[Any]:
    return np.ascontiguousarray(values[::STACKED])
