"""A convolutional network in time, from sequences of vectors to sequences of vectors, and its training."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.threads import one_thread

Array = NDArray[np.float32]
TAPS = 3
"""Time steps that each unit sees of the layer below: one before, the same, one after; ``dilation`` steps apart."""
BLOCK = 4096
"""Time steps computed at a time, so that the memory does not grow with the sequence."""
DECAY_MEAN, DECAY_SQUARE, WEIGHT_DECAY = 0.9, 0.98, 0.01
LARGEST_GRADIENT = 1.0
"""Gradients of a larger norm are shortened to it."""
WARM_UP_SHARE = 0.15
"""Share of the training in which the learning rate rises; then it falls along a cosine to 0."""
SHARDS = 2
"""Parts of a batch, computed in one thread each. Their number is fixed: the sum does not depend on the processors."""


class LinearMap(NamedTuple):
    """Weights [shape=(inputs, outputs)] and biases [shape=(outputs,)] of one layer."""

    weights: Array
    biases: Array


@dataclass(frozen=True, eq=False)
class ConvolutionalNetwork:
    """Convolutions in time with residual connections, and a linear output.

    layers    : convolutions of ``TAPS`` time steps, each followed by max(0, x); the output of each but the first is
                added to its input
    dilations : distance of the taps of each layer, in time steps
    output    : the linear map from the last hidden layer
    Source: Bai, Kolter & Koltun 2018, without causality and without normalisation.
    """

    layers: tuple[LinearMap, ...]
    dilations: tuple[int, ...]
    output: LinearMap

    def __call__(self, inputs: Array) -> Array:
        """Return the outputs of one sequence [shape=(T, O)]; inputs [shape=(T, I)]."""
        return self.hidden(inputs) @ self.output.weights + self.output.biases

    def hidden(self, inputs: Array) -> Array:
        """Return the last hidden layer of one sequence [shape=(T, H)]; inputs [shape=(T, I)]."""
        result = np.empty((len(inputs), len(self.output.weights)), np.float32)
        reach = self.reach
        for start in range(0, len(inputs), BLOCK):
            first, stop = max(start - reach, 0), min(start + BLOCK + reach, len(inputs))
            states, _ = _forward(self, inputs[None, first:stop], None)
            result[start : start + BLOCK] = states[0, start - first : start - first + BLOCK]
        return result

    @property
    def reach(self) -> int:
        """How many time steps before and after a step change its output."""
        return sum(self.dilations)


class TrainingSequence(NamedTuple):
    """One sequence of training: inputs [shape=(T, I)], targets [shape=(T, O)], and which steps count [shape=(T,)]."""

    inputs: NDArray[np.floating]
    targets: Array
    valid: NDArray[np.bool_]


@dataclass(frozen=True)
class TrainingPlan:
    """How a network is trained.

    steps      : number of optimiser steps
    batch_size : sequences of a step
    rate       : largest learning rate
    dropout    : share of the hidden units that are switched off at random
    seed       : of dropout and of the order of sequences
    """

    steps: int
    batch_size: int
    rate: float
    dropout: float
    seed: int


def initial_network(
    inputs: int, hidden: int, outputs: int, dilations: Sequence[int], seed: int
) -> ConvolutionalNetwork:
    """Return an untrained network with random weights (He et al. 2015); those of residual layers are halved."""
    rng = np.random.default_rng(seed)

    def layer(size: int, width: int, factor: float) -> LinearMap:
        weights = rng.standard_normal((size, width)) * np.sqrt(2 / size) * factor
        return LinearMap(weights.astype(np.float32), np.zeros(width, np.float32))

    first = layer(TAPS * inputs, hidden, 1.0)
    others = [layer(TAPS * hidden, hidden, 0.5) for _ in dilations[1:]]
    return ConvolutionalNetwork((first, *others), tuple(dilations), layer(hidden, outputs, 0.1))


@one_thread()
def fit_network(
    network: ConvolutionalNetwork,
    draw: Callable[[np.random.Generator, int], TrainingSequence],
    count: int,
    weights: NDArray[np.floating],
    plan: TrainingPlan,
    report: Callable[[int, float], None],
) -> ConvolutionalNetwork:
    """Return a network that is trained from the given one for least weighted squared error.

    draw    : returns a version of a sequence, by a random generator and the number of the sequence
    count   : number of sequences
    weights : of the outputs [shape=(O,)]
    report  : called after every step with its number, from 1, and the mean error
    Source: Loshchilov & Hutter 2019 (AdamW).
    """
    rng = np.random.default_rng(plan.seed)
    parameters = [array.copy() for layer in (*network.layers, network.output) for array in layer]
    optimiser = _AdamW(parameters)
    queue: list[int] = []
    scale = (weights / weights.sum()).astype(np.float32)
    with ThreadPoolExecutor(SHARDS) as threads:
        for step in range(plan.steps):
            if len(queue) < plan.batch_size:
                queue += rng.permutation(count).tolist() * (1 + plan.batch_size // count)
            chosen, queue = queue[: plan.batch_size], queue[plan.batch_size :]
            batch = [draw(rng, number) for number in chosen]
            valid = max(sum(int(sequence.valid.sum()) for sequence in batch), 1)
            current = _rebuilt(network, parameters)
            seeds = rng.integers(2**63, size=SHARDS)
            jobs = [
                threads.submit(_gradients, current, batch[shard::SHARDS], scale / valid, plan.dropout, int(seed))
                for shard, seed in enumerate(seeds)
            ]
            error, gradients = 0.0, [np.zeros_like(array) for array in parameters]
            for job in jobs:  # in their order: the sum is the same whichever ends first
                shard_error, shard_gradients = job.result()
                error += shard_error
                gradients = [total + each for total, each in zip(gradients, shard_gradients, strict=True)]
            optimiser.step(gradients, _rate(plan, step))
            report(step + 1, error)
    return _rebuilt(network, parameters)


def _rebuilt(network: ConvolutionalNetwork, parameters: Sequence[Array]) -> ConvolutionalNetwork:
    pairs = [LinearMap(*parameters[i : i + 2]) for i in range(0, len(parameters), 2)]
    return ConvolutionalNetwork(tuple(pairs[:-1]), network.dilations, pairs[-1])


def _rate(plan: TrainingPlan, step: int) -> float:
    """Return the learning rate of a step, from 0: one cycle (Smith & Topin 2019)."""
    share = (step + 1) / plan.steps
    if share < WARM_UP_SHARE:
        return plan.rate * share / WARM_UP_SHARE
    return plan.rate * (1 + float(np.cos(np.pi * (share - WARM_UP_SHARE) / (1 - WARM_UP_SHARE)))) / 2


class _AdamW:
    """Moments of the gradients of some parameters, which it changes in place."""

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


class _Pass(NamedTuple):
    """What the backward pass needs of one layer: its stacked inputs, and its derivative times the dropout mask."""

    stacked: Array
    slope: Array


def _forward(
    network: ConvolutionalNetwork, inputs: Array, dropout: tuple[float, np.random.Generator] | None
) -> tuple[Array, list[_Pass]]:
    """Return the last hidden layer of a batch [shape=(B, T, H)], and, with dropout, what the backward pass needs."""
    states, passes = inputs, []
    for number, (layer, dilation) in enumerate(zip(network.layers, network.dilations, strict=True)):
        stacked = _stacked(states, dilation)
        result = stacked @ layer.weights
        result += layer.biases
        if dropout is None:
            np.maximum(result, 0, out=result)
        else:
            share, rng = dropout
            slope = (result > 0) & (rng.random(result.shape, np.float32) >= share)
            passes.append(_Pass(stacked, slope * np.float32(1 / (1 - share))))
            result *= passes[-1].slope
        states = result if number == 0 else states + result
    return states, passes


def _gradients(
    network: ConvolutionalNetwork, batch: Sequence[TrainingSequence], weights: Array, dropout: float, seed: int
) -> tuple[float, list[Array]]:
    """Return the weighted squared error of some sequences, and its gradient for every parameter."""
    if not batch:
        return 0.0, [np.zeros_like(array) for layer in (*network.layers, network.output) for array in layer]
    length = max(len(sequence.inputs) for sequence in batch)
    inputs = np.zeros((len(batch), length, batch[0].inputs.shape[1]), np.float32)
    targets = np.zeros((len(batch), length, len(weights)), np.float32)
    counts = np.zeros((len(batch), length, 1), np.float32)
    for number, sequence in enumerate(batch):
        rows = len(sequence.inputs)
        inputs[number, :rows], targets[number, :rows] = sequence.inputs, sequence.targets
        counts[number, :rows, 0] = sequence.valid
    states, passes = _forward(network, inputs, (dropout, np.random.default_rng(seed)))
    error: Array = (states @ network.output.weights + network.output.biases - targets) * counts
    slope: Array = 2 * error * weights
    flat = slope.reshape(-1, slope.shape[2])
    gradients = [flat.sum(axis=0), states.reshape(len(flat), -1).T @ flat]  # from the last to the first
    back: Array = slope @ network.output.weights.T
    for number in reversed(range(len(network.layers))):
        inner: Array = back * passes[number].slope
        spread: Array = inner.reshape(len(flat), -1)
        gradients += [spread.sum(axis=0), passes[number].stacked.reshape(len(flat), -1).T @ spread]
        if number:
            back = back + _unstacked(inner @ network.layers[number].weights.T, network.dilations[number])
    return float((np.square(error) * weights).sum(dtype=float)), gradients[::-1]


def _stacked(states: Array, dilation: int) -> Array:
    """Return every time step with those before and after it [shape=(B, T, 3·C)]; zeros beyond the ends."""
    batch, length, width = states.shape
    result = np.zeros((batch, length, TAPS, width), np.float32)
    result[:, :, 1] = states
    if dilation < length:
        result[:, dilation:, 0] = states[:, :-dilation]
        result[:, :-dilation, 2] = states[:, dilation:]
    return result.reshape(batch, length, TAPS * width)


def _unstacked(slopes: Array, dilation: int) -> Array:
    """Return the derivative by ``states`` of what ``_stacked`` returns [shape=(B, T, C)], from that by its result."""
    batch, length, width = slopes.shape
    parts = slopes.reshape(batch, length, TAPS, width // TAPS)
    result = parts[:, :, 1].copy()
    if dilation < length:
        result[:, :-dilation] += parts[:, dilation:, 0]
        result[:, dilation:] += parts[:, :-dilation, 2]
    return result
