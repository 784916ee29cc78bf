"""Twins of ``lipmotion.stats``: components by decomposition, transforms term by term, dense matrices, single cells."""

import numpy as np

from lipmotion.stats.constrained_mllr import AffineStatistics
from lipmotion.stats.mixture import Mixtures
from lipmotion.stats.networks import GATES, RecurrentLayer, RecurrentNetwork
from oracles.joint import gaussian, mixture


def components(values: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean, and the first components [shape=(count, D)], the entry furthest from 0 positive."""
    mean = values.mean(axis=0)
    _, _, rows = np.linalg.svd(values - mean, full_matrices=False)
    kept = [row if row[np.abs(row).argmax()] > 0 else -row for row in rows[:count]]
    return mean, np.array(kept)


def share(values: np.ndarray, basis: np.ndarray) -> float:
    """Return the share of the variance that a basis explains."""
    centred = values - values.mean(axis=0)
    return sum(float(np.square(centred @ row).sum()) for row in basis) / float(np.square(centred).sum())


def affine_log_likelihood(
    mixtures: Mixtures, features: np.ndarray, densities: np.ndarray, transform: np.ndarray
) -> float:
    """Return the log density of features, each frame under its own mixture after the transform."""
    total = len(features) * np.log(abs(np.linalg.det(transform[:, :-1])))
    for x, density in zip(features, densities, strict=True):
        of_density = mixtures.log_weights[density], mixtures.means[density], mixtures.variances[density]
        total += mixture(transform[:, :-1] @ x + transform[:, -1], *of_density)
    return float(total)


def affine_statistics(
    mixtures: Mixtures, features: np.ndarray, densities: np.ndarray, transform: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the quadratic and the linear statistics [shapes=(D, D + 1, D + 1), (D, D + 1)]."""
    size = features.shape[1]
    quadratic, linear = np.zeros((size, size + 1, size + 1)), np.zeros((size, size + 1))
    for x, density in zip(features, densities, strict=True):
        current, extended = transform[:, :-1] @ x + transform[:, -1], np.append(x, 1)
        of_density = mixtures.log_weights[density], mixtures.means[density], mixtures.variances[density]
        shares = np.exp([weight + gaussian(current, *of) for weight, *of in zip(*of_density, strict=True)])
        shares /= shares.sum()
        for m, share in enumerate(shares):
            for row in range(size):
                precision = share / mixtures.variances[density, m, row]
                quadratic[row] += precision * np.outer(extended, extended)
                linear[row] += precision * mixtures.means[density, m, row] * extended
    return quadratic, linear


def affine_objective(statistics: AffineStatistics, transform: np.ndarray) -> float:
    """Return the part of the expected log likelihood that depends on a transform [shape=(D, D + 1)].

    Source: Gales 1998, Eq. 25.
    """
    _, log_determinant = np.linalg.slogdet(transform[:, :-1])
    squared = np.einsum("ij,ijk,ik->", transform, statistics.quadratic, transform)
    return float(statistics.count * log_determinant - 0.5 * squared + (statistics.linear * transform).sum())


def window_matrix(frames: int) -> np.ndarray:
    """Return W [shape=(3 T, T)]: static rows, then Δ = (-½, 0, ½), then Δ² = (1, -2, 1); 0 at both ends."""
    static, slope, bend = np.eye(frames), np.zeros((frames, frames)), np.zeros((frames, frames))
    for t in range(1, frames - 1):
        slope[t, t - 1], slope[t, t + 1] = -0.5, 0.5
        bend[t, t - 1], bend[t, t], bend[t, t + 1] = 1, -2, 1
    return np.concatenate([static, slope, bend])


def generate_trajectory(mean, precision, pins=()):
    """Return the trajectory of one channel and its variance, both [shape=(T,)].

    mean, precision : [shape=(T, 3)]
    pins : pairs of frame and value; these frames are taken out of the unknowns
    """
    W = window_matrix(len(mean))
    P = np.diag(precision.T.ravel())
    A, b = W.T @ P @ W, W.T @ P @ mean.T.ravel()
    x, variance = np.zeros(len(mean)), np.zeros(len(mean))
    pinned = dict(pins)
    for frame, value in pinned.items():
        x[frame] = value
    free = [t for t in range(len(mean)) if t not in pinned]
    if free:
        inverse = np.linalg.inv(A[np.ix_(free, free)])
        x[free] = inverse @ (b - A @ x)[free]
        variance[free] = np.diag(inverse)
    return x, variance


def recurrent_outputs(network: RecurrentNetwork, inputs: np.ndarray) -> np.ndarray:
    """Return the outputs of one sequence [shape=(T, O)]."""
    states = np.asarray(inputs, float)
    for layer in network.layers:
        states = np.concatenate([_one_way(layer, 0, states), _one_way(layer, 1, states[::-1])[::-1]], axis=1)
    return states @ network.output.weights + network.output.biases


def _one_way(layer: RecurrentLayer, way: int, inputs: np.ndarray) -> np.ndarray:
    """Return the outputs of the cells of one direction [shape=(T, H)]."""
    cells = layer.memory.shape[1]
    cell, output, outputs = np.zeros(cells), np.zeros(cells), []
    biases = layer.biases.reshape(2, -1)[way]
    for x in inputs:
        gates = x @ layer.weights[way] + output @ layer.memory[way] + biases
        taken, kept, value, shown = gates.reshape(GATES, cells)
        cell = sigmoid(kept) * cell + sigmoid(taken) * np.tanh(value)
        output = sigmoid(shown) * np.tanh(cell)
        outputs.append(output)
    return np.array(outputs)


def sigmoid(x: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-x))


def random_mixtures(draw, shape, weight=1.0, spread=2.0, variances=(0.3, 1.5)) -> Mixtures:
    """Return mixtures [shape=(G, M, D)] of random weights, of random means about 0, and of random variances."""
    return Mixtures(
        np.log(draw.dirichlet(np.full(shape[1], weight), shape[0])).astype(np.float32),
        draw.normal(0, spread, shape).astype(np.float32),
        draw.uniform(*variances, shape).astype(np.float32),
    )
