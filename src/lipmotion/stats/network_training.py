"""Training of networks from sequences of vectors to sequences of vectors."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any, ClassVar, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiler import limit_threads

Array = NDArray[np.float32]
NetworkT = TypeVar("NetworkT", bound="SequenceNetwork")
DECAY_MEAN, DECAY_SQUARE, WEIGHT_DECAY = 0.9, 0.98, 0.01
LARGEST_GRADIENT = 1.0  # gradients of a larger norm are shortened to it
WARM_UP_SHARE = 0.15  # share of the training in which the learning rate rises; then it falls along a cosine to 0


class LinearMap(NamedTuple):
    """Weights [shape=(inputs, outputs)] and biases [shape=(outputs,)] of one layer."""

    weights: Array
    biases: Array


class Dropout(NamedTuple):
    """The share of the hidden units that are switched off, and the generator that draws them."""

    share: float
    rng: np.random.Generator

    def draw(self, shape: tuple[int, ...]) -> Array:
        """Return the factors of the units [shape as given]: 0 where they are off, else what makes up for these."""
        return (self.rng.random(shape, np.float32) >= self.share) * np.float32(1 / (1 - self.share))


class SequenceNetwork(ABC):
    """A network whose last layer is a linear map of hidden units, at every time step.

    layers : the parameters of all layers below
    output : the linear map
    SHARDS : parts of a batch, one thread each; their number is fixed: the sum does not depend on the processors
    """

    layers: tuple[Any, ...]
    output: LinearMap
    SHARDS: ClassVar[int] = 1

    def __call__(self, inputs: Array) -> Array:
        """Return the outputs of one sequence [shape=(T, O)]; inputs [shape=(T, I)]."""
        return self.hidden(inputs) @ self.output.weights + self.output.biases

    @abstractmethod
    def hidden(self, inputs: Array) -> Array:
        """Return the last hidden layer of one sequence [shape=(T, H)]; inputs [shape=(T, I)]."""

    @property
    def parameters(self) -> list[Array]:
        """All weights and biases; the last two are those of ``output``."""
        return [array for layer in (*self.layers, self.output) for array in layer]

    def with_parameters(self: NetworkT, parameters: Sequence[Array]) -> NetworkT:
        """Return the network with other weights and biases, in the order of ``parameters``."""
        arrays = iter(parameters)
        *layers, output = (type(layer)(*islice(arrays, len(layer))) for layer in (*self.layers, self.output))
        return cast(NetworkT, replace(cast(Any, self), layers=tuple(layers), output=output))

    @abstractmethod
    def forward(self, inputs: Array, inside: NDArray[np.bool_], dropout: Dropout | None) -> tuple[Array, Any]:
        """Return a batch's last hidden layer [(B, T, H)], and what ``backward`` needs; ``inside``: before each end."""

    @abstractmethod
    def backward(self, slope: Array, passed: Any) -> list[Array]:
        """Return the gradient of all parameters but ``output`` from that of the last layer [shape=(B, T, H)]."""


class TrainingSequence(NamedTuple):
    """One sequence of training: inputs [shape=(T, I)], targets [shape=(T, O)], and which steps count [shape=(T,)]."""

    inputs: NDArray[np.floating]
    targets: Array
    valid: NDArray[np.bool_]


@dataclass(frozen=True)
class TrainingPlan:
    """How a network is trained.

    rate       : largest learning rate
    dropout    : share of the hidden units that are switched off at random
    seed       : of dropout and of the order of sequences
    """

    steps: int
    batch_size: int
    rate: float
    dropout: float
    seed: int


@limit_threads()
def fit_network(
    network: NetworkT,
    draw: Callable[[np.random.Generator, int], TrainingSequence],
    count: int,
    weights: NDArray[np.floating],
    plan: TrainingPlan,
    report: Callable[[int, float], None],
) -> NetworkT:
    """Return a network that is trained from the given one for least weighted squared error.

    draw    : returns a version of a sequence, by a random generator and the number of the sequence
    weights : of the outputs [shape=(O,)]
    report  : called after every step with its number, from 1, and the mean error
    Source: Loshchilov & Hutter 2019 (AdamW).
    """
    rng = np.random.default_rng(plan.seed)
    parameters = [array.copy() for array in network.parameters]
    optimiser = _AdamW(parameters)
    queue: list[int] = []
    scale = (weights / weights.sum()).astype(np.float32)
    shards = network.SHARDS
    with ThreadPoolExecutor(shards) as threads:
        for step in range(plan.steps):
            if len(queue) < plan.batch_size:
                queue += rng.permutation(count).tolist() * (1 + plan.batch_size // count)
            chosen, queue = queue[: plan.batch_size], queue[plan.batch_size :]
            batch = [draw(rng, number) for number in chosen]
            valid = max(sum(int(sequence.valid.sum()) for sequence in batch), 1)
            current = network.with_parameters(parameters)
            seeds = rng.integers(2**63, size=shards)
            jobs = [
                threads.submit(_differentiate, current, batch[shard::shards], scale / valid, plan.dropout, int(seed))
                for shard, seed in enumerate(seeds)
            ]
            error, gradients = 0.0, [np.zeros_like(array) for array in parameters]
            for job in jobs:  # in their order: the sum is the same whichever ends first
                shard_error, shard_gradients = job.result()
                error += shard_error
                gradients = [total + each for total, each in zip(gradients, shard_gradients, strict=True)]
            share = (step + 1) / plan.steps  # one cycle of the learning rate (Smith & Topin 2019)
            fall = (1 + float(np.cos(np.pi * (share - WARM_UP_SHARE) / (1 - WARM_UP_SHARE)))) / 2
            optimiser.step(gradients, plan.rate * (share / WARM_UP_SHARE if share < WARM_UP_SHARE else fall))
            report(step + 1, error)
    return network.with_parameters(parameters)


class _AdamW:
    def __init__(self, parameters: Sequence[Array]) -> None:
        self.parameters = parameters
        self.means = [np.zeros_like(array) for array in parameters]
        self.squares = [np.zeros_like(array) for array in parameters]
        self.steps = 0

    def step(self, gradients: Sequence[Array], rate: float) -> None:
        self.steps += 1
        norm = float(np.sqrt(sum(float(np.square(gradient).sum(dtype=float)) for gradient in gradients)))
        factor = np.float32(min(1.0, LARGEST_GRADIENT / max(norm, 1e-12)))
        first, second = 1 - DECAY_MEAN**self.steps, 1 - DECAY_SQUARE**self.steps
        for number, gradient in enumerate(gradients):
            parameter, mean, square = self.parameters[number], self.means[number], self.squares[number]
            scaled = gradient * factor
            np.add(mean, np.float32(1 - DECAY_MEAN) * (scaled - mean), out=mean)
            np.add(square, np.float32(1 - DECAY_SQUARE) * (scaled * scaled - square), out=square)
            change = mean / (np.float32(first) * (np.sqrt(square / np.float32(second)) + np.float32(1e-8)))
            if parameter.ndim > 1:
                change += np.float32(WEIGHT_DECAY) * parameter
            np.subtract(parameter, np.float32(rate) * change, out=parameter)


def pad_batch(sequences: Sequence[NDArray[Any]]) -> tuple[Array, NDArray[np.bool_]]:
    """Return B sequences [each shape=(T_i, I)] as one table [shape=(B, T, I)], and where it is before their ends."""
    inside = np.arange(max(map(len, sequences))) < np.array([len(each) for each in sequences])[:, None]
    batch = np.zeros((*inside.shape, sequences[0].shape[1]), np.float32)
    batch[inside] = np.concatenate(sequences)
    return batch, inside


def _differentiate(
    network: SequenceNetwork, batch: Sequence[TrainingSequence], weights: Array, dropout: float, seed: int
) -> tuple[float, list[Array]]:
    """Return the weighted squared error of some sequences, and its gradient for every parameter."""
    if not batch:
        return 0.0, [np.zeros_like(array) for array in network.parameters]
    inputs, inside = pad_batch([sequence.inputs for sequence in batch])
    targets, _ = pad_batch([sequence.targets for sequence in batch])
    counts, _ = pad_batch([sequence.valid[:, None] for sequence in batch])
    states, passed = network.forward(inputs, inside, Dropout(dropout, np.random.default_rng(seed)))
    error: Array = (states @ network.output.weights + network.output.biases - targets) * counts
    slope: Array = 2 * error * weights
    flat = slope.reshape(-1, slope.shape[2])
    of_output = [states.reshape(len(flat), -1).T @ flat, flat.sum(axis=0)]
    gradients = network.backward(slope @ network.output.weights.T, passed)
    return float((np.square(error) * weights).sum(dtype=float)), gradients + of_output
