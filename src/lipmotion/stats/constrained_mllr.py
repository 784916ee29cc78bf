"""Affine transforms of features that maximise their likelihood under Gaussians (constrained MLLR)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.stats.mixture import Mixtures

Array = NDArray[np.float64]
SWEEPS = 8  # how often all rows are re-estimated, one after the other, from one set of statistics


@dataclass(frozen=True, eq=False)
class AffineStatistics:
    """Sufficient statistics of frames for a transform.

    count     : β, the number of frames
    quadratic : for each row of the transform [shape=(D, D + 1, D + 1)], the sum over frames and Gaussians of
                posterior / variance · ζ ζᵀ, where ζ are the features of a frame and 1
    linear    : for each row [shape=(D, D + 1)], the sum of posterior · mean / variance · ζ
    """

    count: float
    quadratic: Array
    linear: Array

    def __add__(self, other: AffineStatistics) -> AffineStatistics:
        return AffineStatistics(self.count + other.count, self.quadratic + other.quadratic, self.linear + other.linear)

    def times(self, factor: float) -> AffineStatistics:
        """Return the statistics of ``factor`` times as many such frames."""
        return AffineStatistics(factor * self.count, factor * self.quadratic, factor * self.linear)


class TransformStatistics(NamedTuple):
    """The statistics of the E-step for a transform, and the log likelihood of the frames under the transform so far."""

    statistics: AffineStatistics
    log_likelihood: float

    @property
    def mean_log_likelihood(self) -> float:
        """Mean log likelihood per frame."""
        return self.log_likelihood / max(self.statistics.count, 1.0)


def identity(size: int) -> Array:
    """Return the transform that changes nothing [shape=(D, D + 1)]."""
    return np.eye(size, size + 1)


def transform_features(features: NDArray[np.float32], transform: Array) -> NDArray[np.float32]:
    """Return the features [shape=(T, D)] after a transform [shape=(D, D + 1)]."""
    matrix, offset = transform[:, :-1].T.astype(np.float32), transform[:, -1].astype(np.float32)
    return np.asarray(features @ matrix + offset, np.float32)


def log_determinant(transform: Array) -> float:
    """Return the log-determinant of a transform, which it adds to the log density of every frame."""
    return float(np.linalg.slogdet(transform[:, :-1])[1])


def collect_transform_statistics(
    mixtures: Mixtures, features: NDArray[np.float32], densities: NDArray[np.intp], transform: Array
) -> TransformStatistics:
    """Return the statistics of frames of known densities [shapes=(T, D), (T,)], under the transform so far."""
    current = transform_features(features, transform)
    precision, target = (np.zeros(features.shape) for _ in range(2))
    log_likelihood = len(features) * log_determinant(transform)
    for density in np.unique(densities):
        of_density = np.flatnonzero(densities == density)
        components = mixtures.log_components(current[of_density], np.array([density]))[:, 0].astype(float)
        total = np.logaddexp.reduce(components, axis=1)
        posterior = np.exp(components - total[:, None])
        precision[of_density] = posterior @ (1 / mixtures.variances[density])
        target[of_density] = posterior @ (mixtures.means[density] / mixtures.variances[density])
        log_likelihood += float(total.sum())
    extended = np.concatenate([features, np.ones((len(features), 1))], axis=1)
    quadratic = np.stack([(extended * weights[:, None]).T @ extended for weights in precision.T])
    return TransformStatistics(AffineStatistics(float(len(features)), quadratic, target.T @ extended), log_likelihood)


def create_prior(mixtures: Mixtures, densities: NDArray[np.intp]) -> AffineStatistics:
    """Return the expected statistics of one frame drawn from densities, each equally often.

    densities : their numbers [shape=(N,)]
    The transform that maximises their likelihood is the identity: as a prior they draw any transform towards it.
    """
    weights = np.exp(mixtures.log_weights[densities].astype(float)).ravel() / len(densities)
    used = np.flatnonzero(weights)
    size = mixtures.means.shape[2]
    means = mixtures.means[densities].reshape(-1, size)[used].astype(float)
    variances = mixtures.variances[densities].reshape(-1, size)[used].astype(float)
    extended = np.concatenate([means, np.ones((len(means), 1))], axis=1)
    precision = weights[used, None] / variances
    quadratic = np.stack([(extended * weights_of_row[:, None]).T @ extended for weights_of_row in precision.T])
    spread = precision.T @ variances
    quadratic[:, np.arange(size), np.arange(size)] += spread
    return AffineStatistics(float(weights.sum()), quadratic, (precision * means).T @ extended)


def improve_transform(
    transform: Array, statistics: AffineStatistics, free: NDArray[np.bool_], sweeps: int = SWEEPS
) -> Array:
    """Return a transform [shape=(D, D + 1)] whose expected log likelihood (Gales 1998, Eq. 25) is at least as high.

    Each row in turn is set to its best values given the others.
    free : the entries that may change [shape=(D, D + 1)], the diagonal among them; others stay
    Source: Gales 1998, §3.2 and appendix: a row's best values are a quadratic equation given the cofactors.
    Cost: O(sweeps · D⁴).
    """
    result = transform.copy()
    for _ in range(sweeps):
        for row in range(len(result)):
            columns = np.flatnonzero(free[row])
            cofactors = np.append(np.linalg.inv(result[:, :-1])[:, row], 0.0)
            old = result[row]
            fixed = np.where(np.isin(np.arange(len(old)), columns), 0.0, old)
            inverse = np.linalg.inv(statistics.quadratic[row][np.ix_(columns, columns)])
            target = (statistics.linear[row] - statistics.quadratic[row] @ fixed)[columns]
            volume, offset = cofactors[columns], float(cofactors @ fixed)
            # α maximises β log|α·a + b + offset| − α²·a / 2
            a, b = float(volume @ inverse @ volume), float(volume @ inverse @ target) + offset
            root = np.sqrt(b * b + 4 * a * statistics.count)
            alphas = np.array([(-b + root) / (2 * a), (-b - root) / (2 * a)])
            values = statistics.count * np.log(np.abs(alphas * a + b)) - alphas * alphas * a / 2
            result[row, columns] = np.asarray((alphas[int(values.argmax())] * volume + target) @ inverse)
    return result
