"""Posterior networks: motion from the posteriors of a phone recogniser, which are much the same for every speaker."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.motion.network_steps import (
    LEAST_DEVIATION,
    STEP,
    NetworkShape,
    between_steps,
    checked_scale,
    random_piece,
)
from lipmotion.motion.predictors import PredictorTraining
from lipmotion.stats.convolution import ConvolutionalNetwork, TrainingPlan, TrainingSequence
from lipmotion.storage.schema import LARGEST_MEAN, Arrays, ArraySpec, checked_arrays
from lipmotion.types import TokenPosteriors

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
SHAPE = NetworkShape("posterior", "posterior-network", ROWS * COMPONENTS, 96, (1, 2, 4, 1, 2, 4))
"""Its input is 0.56 s before and after a frame."""
PLAN = TrainingPlan(steps=800, batch_size=16, rate=2e-3, dropout=0.4, seed=0)
LARGEST_COMPONENT = 100.0
"""More is in no basis."""

TARGETS = {
    "posterior_mean": ArraySpec(np.float32, "K", -LARGEST_MEAN, LARGEST_MEAN),
    "posterior_basis": ArraySpec(np.float32, f"K {COMPONENTS}", -LARGEST_COMPONENT, LARGEST_COMPONENT),
    "posterior_targets": ArraySpec(np.float64, "2 Q", -1e6, 1e6),
    "posterior_source": ArraySpec(np.str_, "1"),
}
POSTERIOR_ARRAYS = SHAPE.specs | TARGETS


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
        steps = self.network(self._inputs(posteriors)).astype(float)
        return between_steps(steps, frames) * self.scale + self.centre

    def hidden(self, posteriors: TokenPosteriors, steps: int) -> NDArray[np.float32]:
        """Return the last hidden layer in every time step [shape=(steps, H)]; raises InputError as ``predict``."""
        rows = self.network.hidden(self._inputs(posteriors))
        return rows[np.minimum(np.arange(steps), len(rows) - 1)]

    def _inputs(self, posteriors: TokenPosteriors) -> NDArray[np.float32]:
        """Return the inputs in every time step [shape=(ceil(N / 2), 240)]; raises InputError as ``predict``."""
        if posteriors.source != self.source:
            raise InputError(
                f"the model was trained with the phone recogniser {self.source}, this one is {posteriors.source}; "
                f"install that one (pip install {'=='.join(self.source.split()[:2])}), or use the recogniser fast"
            )
        return _steps(_limited(posteriors), self.mean, self.basis)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Serialise the network, at half precision."""
        arrays = SHAPE.arrays(self.network) | {"posterior_mean": self.mean, "posterior_basis": self.basis}
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
    network = SHAPE.trained(training, len(centre), lambda rng, number: random_piece(pieces[number], rng), PLAN)
    return PosteriorNetwork(network, mean, basis, centre, scale, known[0].source)


def posterior_network_from_arrays(arrays: Arrays, dimensions: int) -> PosteriorNetwork | None:
    """Deserialise a network; None where there is none.

    dimensions : of the motion space, Q
    Raises KeyError, ValueError: an array is missing, or has a wrong shape, type or range.
    """
    if arrays.keys().isdisjoint(POSTERIOR_ARRAYS):
        return None
    stored = checked_arrays(arrays, TARGETS, Q=dimensions)
    centre, scale = stored["posterior_targets"]
    return PosteriorNetwork(
        SHAPE.from_arrays(arrays, dimensions),
        stored["posterior_mean"],
        stored["posterior_basis"],
        centre,
        checked_scale(scale, "posterior_targets"),
        str(stored["posterior_source"][0]),
    )


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
