"""Affine transforms of features, computed for one frame, Gaussian and row at a time."""

import numpy as np

from lipmotion.stats.constrained_mllr import AffineStatistics
from lipmotion.stats.mixture import Mixtures
from oracles.joint import gaussian, mixture


def log_likelihood(mixtures: Mixtures, features: np.ndarray, densities: np.ndarray, transform: np.ndarray) -> float:
    """Return the log density of features before the transform, each frame under its own mixture after the transform."""
    total = len(features) * np.log(abs(np.linalg.det(transform[:, :-1])))
    for x, density in zip(features, densities, strict=True):
        of_density = mixtures.log_weights[density], mixtures.means[density], mixtures.variances[density]
        total += mixture(transform[:, :-1] @ x + transform[:, -1], *of_density)
    return float(total)


def statistics(
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


def objective(statistics: AffineStatistics, transform: np.ndarray) -> float:
    """Return the part of the expected log likelihood that depends on a transform [shape=(D, D + 1)].

    Source: Gales 1998, Eq. 25.
    """
    _, log_determinant = np.linalg.slogdet(transform[:, :-1])
    squared = np.einsum("ij,ijk,ik->", transform, statistics.quadratic, transform)
    return float(statistics.count * log_determinant - 0.5 * squared + (statistics.linear * transform).sum())
