"""Posterior networks: motion from the posteriors of a phone recogniser, which are much the same for every speaker."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.motion.network_steps import DIRECT_WEIGHT, LEAST_DEVIATION, STEP, between_steps, random_piece
from lipmotion.motion.predictors import PredictorTraining
from lipmotion.stats.convolution import (
    TAPS,
    ConvolutionalNetwork,
    LinearMap,
    TrainingPlan,
    TrainingSequence,
    fit_network,
    initial_network,
)
from lipmotion.storage.schema import LARGEST_MEAN, Arrays, ArraySpec, checked_arrays
from lipmotion.types import Progress, TokenPosteriors

Array = NDArray[np.float64]
ROWS = 2
"""Rows of posteriors, of 20 ms each, in a time step of the network."""
COMPONENTS = 120
"""Principal components of the logarithms of the posteriors: what the network says of phones that are not there tells
more than the phone that is."""
LEAST_LOG_POSTERIOR = -12.0
"""Smaller logarithms count as this: the network does not mean them."""
INPUT_SCALE = 2.0
"""Standard deviation of the first principal component as input; the others keep their proportions to it."""
HIDDEN_UNITS, DILATIONS = 96, (1, 2, 4, 1, 2, 4)
"""Units of a hidden layer, and time steps between its taps: its input is 0.56 s before and after a frame."""
STEPS, BATCH_SIZE, LEARNING_RATE, DROPOUT, SEED = 800, 16, 2e-3, 0.4, 0
CHECKPOINT = "posterior-network"
LARGEST_COMPONENT = 100.0
"""More is in no basis."""

WEIGHTS = {
    "posterior_first": ArraySpec(np.float32, f"{TAPS * ROWS * COMPONENTS} {HIDDEN_UNITS}", -LARGEST_MEAN, LARGEST_MEAN),
    "posterior_layers": ArraySpec(
        np.float32, f"{len(DILATIONS) - 1} {TAPS * HIDDEN_UNITS} {HIDDEN_UNITS}", -LARGEST_MEAN, LARGEST_MEAN
    ),
    "posterior_biases": ArraySpec(np.float32, f"{len(DILATIONS)} {HIDDEN_UNITS}", -LARGEST_MEAN, LARGEST_MEAN),
    "posterior_output": ArraySpec(np.float32, f"{HIDDEN_UNITS + 1} Q", -LARGEST_MEAN, LARGEST_MEAN),
}
TARGETS = {
    "posterior_mean": ArraySpec(np.float32, "K", -LARGEST_MEAN, LARGEST_MEAN),
    "posterior_basis": ArraySpec(np.float32, f"K {COMPONENTS}", -LARGEST_COMPONENT, LARGEST_COMPONENT),
    "posterior_targets": ArraySpec(np.float64, "2 Q", -1e6, 1e6),
    "posterior_source": ArraySpec(np.str_, "1"),
}
POSTERIOR_ARRAYS = WEIGHTS | TARGETS


@dataclass(frozen=True, eq=False)
class PosteriorNetwork:
    """A network from posteriors to motion.

    network     : its outputs are Q standardised dimensions of motion
    mean, basis : of the logarithms of the posteriors [shape=(K,)], and from them to the inputs [shape=(K, 120)]
    centre, scale : mean and standard deviation of the motion in training [each shape=(Q,)]
    source      : name, version and digest of the phone recogniser (``TokenPosteriors.source``)
    """

    network: ConvolutionalNetwork
    mean: NDArray[np.float32]
    basis: NDArray[np.float32]
    centre: Array
    scale: Array
    source: str

    def predict(self, posteriors: TokenPosteriors, frames: int) -> Array:
        """Return motion in the motion space [shape=(frames, Q)].

        Raises InputError: posteriors of another phone recogniser than that of the training.
        """
        if posteriors.source != self.source:
            raise InputError(
                f"the model was trained with the phone recogniser {self.source}, this one is {posteriors.source}; "
                f"install that one (pip install {'=='.join(self.source.split()[:2])}), or use the recogniser fast"
            )
        steps = self.network(_steps(_limited(posteriors), self.mean, self.basis)).astype(float)
        return between_steps(steps, frames) * self.scale + self.centre

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Serialise the network, at half precision."""
        arrays = _weights(self.network) | {"posterior_mean": self.mean, "posterior_basis": self.basis}
        return {name: array.astype(np.float16) for name, array in arrays.items()} | {
            "posterior_targets": np.stack([self.centre, self.scale]),
            "posterior_source": np.array([self.source]),
        }


def fit_posterior_network(training: PredictorTraining, centre: Array, scale: Array) -> PosteriorNetwork | None:
    """Return a network that is trained on the posteriors of examples; None where one of them has none.

    centre, scale : of the motion [each shape=(Q,)]
    """
    found = [example.speech.posteriors for example in training.examples]
    known = [posteriors for posteriors in found if posteriors is not None]
    if not known or len(known) < len(found):
        return None
    rows = [_limited(posteriors) for posteriors in known]
    mean, basis = _principal_components(rows)
    pieces = [
        _sequence(_steps(row, mean, basis), (x - centre) / scale, example.valid)
        for row, x, example in zip(rows, training.values, training.examples, strict=True)
    ]
    weights = np.ones(len(centre))
    weights[: training.direct] = DIRECT_WEIGHT
    stored = training.checkpoint.load(CHECKPOINT)
    network = _network(stored, len(centre)) if stored is not None else _trained(training, pieces, weights)
    return PosteriorNetwork(network, mean, basis, centre, scale, known[0].source)


def _trained(training: PredictorTraining, pieces: Sequence[TrainingSequence], weights: Array) -> ConvolutionalNetwork:
    """Return the trained network, which is stored as a checkpoint."""

    def report(step: int, error: float) -> None:
        if step % 50 == 0 or step == STEPS:
            training.monitor(Progress("training the network of posteriors", step, STEPS, error))

    network = fit_network(
        initial_network(ROWS * COMPONENTS, HIDDEN_UNITS, len(weights), DILATIONS, SEED),
        lambda rng, number: random_piece(pieces[number], rng),
        len(pieces),
        weights,
        TrainingPlan(STEPS, BATCH_SIZE, LEARNING_RATE, DROPOUT, SEED),
        report,
    )
    training.checkpoint.save(CHECKPOINT, _weights(network))
    return network


def posterior_network_from_arrays(arrays: Arrays, dimensions: int) -> PosteriorNetwork | None:
    """Deserialise a network; None where there is none.

    dimensions : of the motion space, Q
    Raises KeyError, ValueError: an array is missing, or has a wrong shape, type or range.
    """
    if arrays.keys().isdisjoint(POSTERIOR_ARRAYS):
        return None
    stored = checked_arrays(arrays, TARGETS, Q=dimensions)
    centre, scale = stored["posterior_targets"]
    if not (scale > 0).all():
        raise ValueError("posterior_targets with a scale that is not more than 0")
    return PosteriorNetwork(
        _network(arrays, dimensions),
        stored["posterior_mean"],
        stored["posterior_basis"],
        centre,
        scale,
        str(stored["posterior_source"][0]),
    )


def _weights(network: ConvolutionalNetwork) -> dict[str, NDArray[np.float32]]:
    return {
        "posterior_first": network.layers[0].weights,
        "posterior_layers": np.stack([layer.weights for layer in network.layers[1:]]),
        "posterior_biases": np.stack([layer.biases for layer in network.layers]),
        "posterior_output": np.concatenate([network.output.weights, network.output.biases[None]]),
    }


def _network(arrays: Arrays, dimensions: int) -> ConvolutionalNetwork:
    stored = checked_arrays(arrays, WEIGHTS, Q=dimensions)
    weights = [stored["posterior_first"], *stored["posterior_layers"]]
    layers = tuple(LinearMap(each, biases) for each, biases in zip(weights, stored["posterior_biases"], strict=True))
    output = stored["posterior_output"]
    return ConvolutionalNetwork(layers, DILATIONS, LinearMap(output[:-1], output[-1]))


def _principal_components(rows: Sequence[NDArray[np.float32]]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the mean of posteriors [shape=(K,)] and a basis, scaled as inputs of the network [shape=(K, 120)]."""
    everything = np.concatenate(rows).astype(float)
    mean = everything.mean(axis=0)
    values, vectors = np.linalg.eigh(np.cov(everything - mean, rowvar=False))
    chosen = vectors[:, ::-1][:, :COMPONENTS]
    basis = np.zeros((len(mean), COMPONENTS))
    basis[:, : chosen.shape[1]] = chosen * (INPUT_SCALE / max(float(np.sqrt(values[-1])), LEAST_DEVIATION))
    return mean.astype(np.float32), basis.astype(np.float32)


def _sequence(inputs: NDArray[np.float32], targets: Array, valid: NDArray[np.bool_]) -> TrainingSequence:
    """Return the inputs of a recording, and the targets [shape=(T, Q)] at its time steps."""
    frames = np.minimum(np.arange(len(inputs)) * STEP, len(targets) - 1)
    return TrainingSequence(inputs, targets[frames].astype(np.float32), valid[frames])


def _limited(posteriors: TokenPosteriors) -> NDArray[np.float32]:
    """Return the logarithms of posteriors within the limit [shape=(N, K)]."""
    limited: NDArray[np.float32] = np.maximum(posteriors.values, LEAST_LOG_POSTERIOR).astype(np.float32)
    return limited


def _steps(rows: NDArray[np.float32], mean: NDArray[np.float32], basis: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the components of the rows of every time step, concatenated [shape=(ceil(N / 2), 240)]."""
    components = (rows - mean) @ basis
    filled = np.concatenate([components, np.repeat(components[-1:], len(rows) % ROWS, axis=0)])
    return filled.reshape(-1, ROWS * basis.shape[1]).astype(np.float32)
