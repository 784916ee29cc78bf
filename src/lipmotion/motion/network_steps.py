"""What networks share: time steps of 40 ms, frames of 10 ms between them, training, storage; and the general network.

The general network hears motion in the encoding of speech alone, for every voice; it learned from hundreds of readers.
``scripts/live_network.py`` trains it on measured motion of one speaker, and on what ``animate`` makes of the others'
recordings, in quiet and in noise: mistakes differ from reader to reader, and the network learns what they share
(Xie, Luong, Hovy & Le 2020, self-training). It needs no phones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.articulation import ARTICULATORS
from lipmotion.motion.predictors import PredictorTraining
from lipmotion.stats.curves import mark_known_dynamics, with_dynamics
from lipmotion.stats.network_training import LinearMap, SequenceNetwork, TrainingPlan, TrainingSequence, fit_network
from lipmotion.stats.networks import (
    GATES,
    TAPS,
    ConvolutionalNetwork,
    RecurrentLayer,
    RecurrentNetwork,
    make_network,
    make_recurrent_network,
)
from lipmotion.storage.archive import read_shipped_arrays
from lipmotion.storage.schema import LARGEST_MEAN, Arrays, ArraySpec, check_arrays
from lipmotion.types import Progress, Speech

Array = NDArray[np.float64]
FloatT = TypeVar("FloatT", bound=np.floating[Any])
NetworkT = TypeVar("NetworkT", bound=SequenceNetwork)
STEP = 4  # frames of a time step, 40 ms: about a picture of a video
DIRECT_WEIGHT = 4.0
"""Weight, in training, of the error of a channel that is modelled as it is; that of a principal component is 1."""
MIN_DEVIATION = 1e-6
REPORTED_STEPS = 100  # progress of training is reported after so many optimiser steps
LONGEST_STEPS = 250  # longer recordings are cut into pieces of so many time steps, 10 s, for training


def interpolate_steps(steps: Array, frames: int, first: int = 0) -> Array:
    """Return values at time steps of 40 ms [shape=(N, C)] interpolated to frames of 10 ms [shape=(frames, C)].

    first : frame of the first time step; those before it have the same values
    Source: Catmull & Rom 1974; the curve has no corners, and passes through the values.
    """
    padded = np.concatenate([steps[:1], steps, steps[-1:], steps[-1:]])
    position, u = np.divmod(np.maximum(np.arange(frames) - first, 0), STEP)
    u = (u / STEP)[:, None]
    before, here, after, last = (padded[np.minimum(position + k, len(padded) - 1)] for k in range(4))
    return here + u / 2 * (
        after - before + u * (2 * before - 5 * here + 4 * after - last + u * (3 * (here - after) + last - before))
    )


def stack_spectrum(spectrum: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return the frames around every time step, concatenated [shape=(ceil(T / 4), 160)]; spectrum [shape=(T, 40)]."""
    centres = np.arange(0, len(spectrum), STEP)
    frames = np.clip(centres[:, None] + np.arange(STEP) - STEP // 2, 0, len(spectrum) - 1)
    return spectrum[frames].reshape(len(centres), -1).astype(np.float32)


def measure_poses(training: PredictorTraining) -> tuple[Array, Array]:
    """Return mean and standard deviation of the measured motion, which standardise it [each shape=(Q,)]."""
    poses = np.concatenate([x[example.valid] for x, example in zip(training.values, training.examples, strict=True)])
    return poses.mean(axis=0), np.maximum(poses.std(axis=0), MIN_DEVIATION)


def measure_error_variances(training: PredictorTraining, predicted: Iterable[Array], scale: Array) -> Array:
    """Return the variances of the error of static value, Δ and Δ² [shape=(3, Q)], not much smaller than ``scale``."""
    squares, count = np.zeros((3, len(scale))), 0
    for example, x, motion in zip(training.examples, training.values, predicted, strict=True):
        frames = mark_known_dynamics(example.valid)
        squares += np.square(with_dynamics(x - motion)[frames]).sum(axis=0)
        count += int(frames.sum())
    return np.maximum(squares / max(count, 1), 1e-4 * np.square(scale) + 1e-12)


def cut_random_piece(sequence: TrainingSequence, rng: np.random.Generator) -> TrainingSequence:
    """Return a sequence, or a piece of it from a random place where it is long."""
    excess = len(sequence.inputs) - LONGEST_STEPS
    if excess <= 0:
        return sequence
    start = int(rng.integers(excess + 1))
    piece = slice(start, start + LONGEST_STEPS)
    return TrainingSequence(sequence.inputs[piece], sequence.targets[piece], sequence.valid[piece])


Draw = Callable[[np.random.Generator, int], TrainingSequence]  # returns a version of a numbered example
Layers = Iterable[Sequence[NDArray[np.float32]]]  # the arrays of each layer


@dataclass(frozen=True)
class NetworkShape(Generic[NetworkT]):
    """Shape of a network, and how it is trained and stored."""

    prefix: str  # of the names of its arrays in a model file
    name: str  # in messages and of its checkpoint
    inputs: int  # values of a time step
    sizes: Mapping[str, str]  # shapes of arrays by name: the first weights, the others, ..., ``output`` of O values
    network: Callable[[Layers, LinearMap], NetworkT]  # returns that of some layers and of the linear map of its output
    initial: Callable[[int, int], NetworkT]  # returns one with random weights: of so many outputs, from a seed

    @property
    def specs(self) -> dict[str, ArraySpec]:
        """Shapes and ranges of the arrays."""
        return {
            f"{self.prefix}_{name}": ArraySpec(np.float32, shape, -LARGEST_MEAN, LARGEST_MEAN)
            for name, shape in self.sizes.items()
        }

    def arrays(self, network: NetworkT) -> dict[str, NDArray[np.float32]]:
        """Return the arrays of a network of this shape: the first layer has other inputs, the rest is stacked."""
        weights, *others = zip(*network.layers, strict=True)
        output = np.concatenate([network.output.weights, network.output.biases[None]])
        arrays = (weights[0], np.stack(weights[1:]), *(np.stack(each) for each in others), output)
        return dict(zip(self.specs, arrays, strict=True))

    def from_arrays(self, arrays: Arrays, outputs: int) -> NetworkT:
        """Return the network of arrays. Raises KeyError, ValueError: one is missing or damaged."""
        stored = check_arrays(arrays, self.specs, O=outputs)
        first, weights, *others, output = (stored[name] for name in self.specs)
        return self.network(zip([first, *weights], *others, strict=True), LinearMap(output[:-1], output[-1]))

    def train(self, training: PredictorTraining, outputs: int, draw: Draw, plan: TrainingPlan) -> NetworkT:
        """Return a network, trained on sequences that ``draw`` makes of numbered examples, or from its checkpoint."""
        stored = training.checkpoint.load(self.name)
        if stored is not None:
            return self.from_arrays(stored, outputs)
        weights = np.ones(outputs)
        weights[: training.direct] = DIRECT_WEIGHT

        def report(step: int, error: float) -> None:
            if step % REPORTED_STEPS == 0 or step == plan.steps:
                stage = f"training the {self.name}"
                training.monitor(Progress(stage, step, plan.steps, step / plan.steps, figure=error))

        network = fit_network(self.initial(outputs, plan.seed), draw, len(training.examples), weights, plan, report)
        training.checkpoint.save(self.name, self.arrays(network))
        return network


def shape_convolutional(
    prefix: str, name: str, inputs: int, hidden: int, dilations: tuple[int, ...]
) -> NetworkShape[ConvolutionalNetwork]:
    """Return the shape of a network with ``hidden`` units a layer; ``dilations``: time steps between a layer's taps."""
    layers = len(dilations)
    sizes = {
        "first": f"{TAPS * inputs} {hidden}",
        "layers": f"{layers - 1} {TAPS * hidden} {hidden}",
        "biases": f"{layers} {hidden}",
        "output": f"{hidden + 1} O",
    }

    def build(maps: Layers, output: LinearMap) -> ConvolutionalNetwork:
        return ConvolutionalNetwork(tuple(LinearMap(*each) for each in maps), dilations, output)

    def begin(outputs: int, seed: int) -> ConvolutionalNetwork:
        return make_network(inputs, hidden, outputs, dilations, seed)

    return NetworkShape(prefix, name, inputs, sizes, build, begin)


def shape_recurrent(prefix: str, name: str, inputs: int, cells: int, layers: int) -> NetworkShape[RecurrentNetwork]:
    """Return the shape of a network with two layers or more, of so many cells in either direction of time."""
    gates = GATES * cells
    sizes = {
        "first": f"2 {inputs} {gates}",
        "layers": f"{layers - 1} 2 {2 * cells} {gates}",
        "memory": f"{layers} 2 {cells} {gates}",
        "biases": f"{layers} {2 * gates}",
        "output": f"{2 * cells + 1} O",
    }

    def build(arrays: Layers, output: LinearMap) -> RecurrentNetwork:
        return RecurrentNetwork(tuple(RecurrentLayer(*each) for each in arrays), output)

    def begin(outputs: int, seed: int) -> RecurrentNetwork:
        return make_recurrent_network(inputs, cells, outputs, layers, seed)

    return NetworkShape(prefix, name, inputs, sizes, build, begin)


def check_scale(scale: NDArray[FloatT], name: str) -> NDArray[FloatT]:
    """Return standard deviations of targets, as stored; raise ValueError where one is not more than 0."""
    if not (scale > 0).all():
        raise ValueError(f"{name} with a scale that is not more than 0")
    return scale


GENERAL_SHAPE = shape_convolutional("general", "general network", 64, 128, (1, 2, 4, 8))
"""From the 64 values of ``Speech.encoding``, 0.6 s before and after a frame."""
ENCODING_SCALE = np.float32(4)  # what the encoding is multiplied by, so that its values are about 1


def hear_articulators(speech: Speech) -> NDArray[np.float64] | None:
    """Return articulators, deviations from the table's pose [shape=(T, 8)]; None: no encoding, or a known voice."""
    if speech.encoding is None or (speech.voice >= 1 and speech.units_known):
        return None
    steps = np.asarray(speech.encoding)[::STEP].astype(np.float32) * ENCODING_SCALE
    return interpolate_steps(load_shipped()(steps).astype(float), len(speech.features.values))


@cache
def load_shipped() -> ConvolutionalNetwork:
    """Return the network of the package."""
    return GENERAL_SHAPE.from_arrays(read_shipped_arrays("general-motion.npz"), len(ARTICULATORS))
