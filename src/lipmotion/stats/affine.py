"""Affine transforms of features that make them most like what Gaussians expect (constrained MLLR)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.stats.mixture import Mixtures

Array = NDArray[np.float64]
SWEEPS = 8
"""Times that all rows are set anew, one after the other, for one set of statistics."""


@dataclass(frozen=True, eq=False)
class AffineStatistics:
    """What frames say about the rows of a transform, given the Gaussian that each belongs to.

    count     : β, the frames
    quadratic : the sum over frames and Gaussians of posterior / variance · ζ ζᵀ [shape=(D, D + 1, D + 1)], row by row,
                where ζ are the features of a frame and 1
    linear    : the sum of posterior · mean / variance · ζ [shape=(D, D + 1)]
    """

    count: float
    quadratic: Array
    linear: Array

    def __add__(self, other: AffineStatistics) -> AffineStatistics:
        return AffineStatistics(self.count + other.count, self.quadratic + other.quadratic, self.linear + other.linear)

    def times(self, factor: float) -> AffineStatistics:
        """Return what ``factor`` times as many frames of the same kind would say."""
        return AffineStatistics(factor * self.count, factor * self.quadratic, factor * self.linear)

    def objective(self, transform: Array) -> float:
        """Return the part of the expected log likelihood that depends on a transform [shape=(D, D + 1)].

        Source: Gales 1998, Eq. 25.
        """
        _, log_determinant = np.linalg.slogdet(transform[:, :-1])
        bent = np.einsum("ij,ijk,ik->", transform, self.quadratic, transform)
        return float(self.count * log_determinant - 0.5 * bent + (self.linear * transform).sum())


def identity(size: int) -> Array:
    """Return the transform that changes nothing [shape=(D, D + 1)]."""
    return np.eye(size, size + 1)


def transformed(features: NDArray[np.float32], transform: Array) -> NDArray[np.float32]:
    """Return features [shape=(T, D)] after a transform [shape=(D, D + 1)]."""
    matrix, offset = transform[:, :-1].T.astype(np.float32), transform[:, -1].astype(np.float32)
    return np.asarray(features @ matrix + offset, np.float32)


def log_determinant(transform: Array) -> float:
    """Return what a transform adds to the log density of every frame."""
    return float(np.linalg.slogdet(transform[:, :-1])[1])


def transform_statistics(
    mixtures: Mixtures, features: NDArray[np.float32], densities: NDArray[np.intp], transform: Array
) -> tuple[AffineStatistics, float]:
    """Return what frames say whose densities are known, and their log likelihood under the transform so far.

    features  : before the transform [shape=(T, D)]
    densities : [shape=(T,)]
    """
    heard = transformed(features, transform)
    precision, pull = (np.zeros(features.shape) for _ in range(2))
    log_likelihood = len(features) * log_determinant(transform)
    for density in np.unique(densities):
        mine = np.flatnonzero(densities == density)
        components = mixtures.log_components(heard[mine], np.array([density]))[:, 0].astype(float)
        total = np.logaddexp.reduce(components, axis=1)
        posterior = np.exp(components - total[:, None])
        precision[mine] = posterior @ (1 / mixtures.variances[density])
        pull[mine] = posterior @ (mixtures.means[density] / mixtures.variances[density])
        log_likelihood += float(total.sum())
    extended = np.concatenate([features, np.ones((len(features), 1))], axis=1)
    quadratic = np.stack([(extended * weights[:, None]).T @ extended for weights in precision.T])
    return AffineStatistics(float(len(features)), quadratic, pull.T @ extended), log_likelihood


def prior_statistics(mixtures: Mixtures, densities: NDArray[np.intp]) -> AffineStatistics:
    """Return what one frame drawn from the densities themselves [shape=(N,)], all as often, says on average.

    Nothing explains it better than the identity: as a prior it draws every transform there.
    """
    weights = np.exp(mixtures.log_weights[densities].astype(float)).ravel() / len(densities)
    used = np.flatnonzero(weights)
    size = mixtures.means.shape[2]
    means = mixtures.means[densities].reshape(-1, size)[used].astype(float)
    variances = mixtures.variances[densities].reshape(-1, size)[used].astype(float)
    extended = np.concatenate([means, np.ones((len(means), 1))], axis=1)
    precision = weights[used, None] / variances
    quadratic = np.stack([(extended * one[:, None]).T @ extended for one in precision.T])
    spread = precision.T @ variances
    quadratic[:, np.arange(size), np.arange(size)] += spread
    return AffineStatistics(float(weights.sum()), quadratic, (precision * means).T @ extended)


def improved_transform(
    transform: Array, statistics: AffineStatistics, free: NDArray[np.bool_], sweeps: int = SWEEPS
) -> Array:
    """Return a transform [shape=(D, D + 1)] with no less ``AffineStatistics.objective``, row after row the best.

    free : the entries that may change [shape=(D, D + 1)], the diagonal among them; others stay
    Source: Gales 1998, §3.2 and appendix: a row's best values are a quadratic equation given the cofactors.
    Cost: O(sweeps · D⁴).
    """
    result = transform.copy()
    for _ in range(sweeps):
        for row in range(len(result)):
            columns = np.flatnonzero(free[row])
            cofactors = np.append(np.linalg.inv(result[:, :-1])[:, row], 0.0)
            result[row, columns] = _best_row(result[row], columns, cofactors, statistics, row)
    return result


def _best_row(old: Array, columns: NDArray[np.intp], cofactors: Array, statistics: AffineStatistics, row: int) -> Array:
    fixed = np.where(np.isin(np.arange(len(old)), columns), 0.0, old)
    inverse = np.linalg.inv(statistics.quadratic[row][np.ix_(columns, columns)])
    pull = (statistics.linear[row] - statistics.quadratic[row] @ fixed)[columns]
    volume, offset = cofactors[columns], float(cofactors @ fixed)
    # α maximises β log|α·a + b + offset| − α²·a / 2
    a, b = float(volume @ inverse @ volume), float(volume @ inverse @ pull) + offset
    root = np.sqrt(b * b + 4 * a * statistics.count)
    alphas = np.array([(-b + root) / (2 * a), (-b - root) / (2 * a)])
    values = statistics.count * np.log(np.abs(alphas * a + b)) - alphas * alphas * a / 2
    return np.asarray((alphas[int(values.argmax())] * volume + pull) @ inverse)
