"""Sets of mixture densities of diagonal Gaussians."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.storage.schema import LARGEST_MEAN, LARGEST_VARIANCE, POSITIVE, ArraySpec, CheckedArrays

SPLIT_STEP = 0.2  # the halves of a split component move by so many standard deviations, in opposite directions
BLOCK = 256  # frames whose components are computed at a time: these fit into the cache
MIN_LOG_SHARE = np.float32(-50)  # smallest logarithm of a component's posterior, relative to the best component
LOG_2PI = float(np.log(2 * np.pi))
MIXTURES = {
    "log_weights": ArraySpec(np.float32, "G M", -np.inf, 0.1),
    "means": ArraySpec(np.float32, "G M D", -LARGEST_MEAN, LARGEST_MEAN),
    "variances": ArraySpec(np.float32, "G M D", POSITIVE, LARGEST_VARIANCE),
}
"""How mixtures of standardised values are stored; weights may be rounded to half precision."""
MIN_WEIGHT, MAX_WEIGHT = 0.5, 1.5  # limits of the sum of a density's stored weights, which is 1 but for rounding


@dataclass(frozen=True, eq=False)
class Mixtures:
    """G mixtures of M diagonal Gaussians: log weights [(G, M)], -inf: unused; means and variances [(G, M, D)]."""

    log_weights: NDArray[np.float32]
    means: NDArray[np.float32]
    variances: NDArray[np.float32]

    @property
    def size(self) -> tuple[int, int, int]:
        """Numbers of densities G, components M and dimensions D."""
        G, M, D = self.means.shape
        return G, M, D

    def log_components(self, x: NDArray[np.float32], chosen: NDArray[np.intp] | None = None) -> NDArray[np.float32]:
        """Return log weight + log density of every component [shape=(T, G', M)].

        x      : [shape=(T, D)]
        chosen : [shape=(G',)], the numbers of the densities to compute; None: all
        Cost: O(T·G'·M·D), as one matrix product.
        """
        return self.quadratic(chosen).log_components(x).transpose(0, 2, 1)

    def log_likelihood(self, x: NDArray[np.float32], chosen: NDArray[np.intp] | None = None) -> NDArray[np.float32]:
        """Return the log density of every frame under every chosen mixture [shape=(T, G')]; see ``log_components``."""
        return self.quadratic(chosen).log_likelihood(x)

    def quadratic(self, chosen: NDArray[np.intp] | None = None) -> QuadraticForm:
        """Return the chosen densities as the coefficients of a quadratic form; None: all."""
        pick = slice(None) if chosen is None else chosen
        means, precision = self.means[pick], 1 / self.variances[pick]
        volume = means.shape[2] * LOG_2PI - np.log(precision).sum(axis=2)
        constant = self.log_weights[pick] - 0.5 * (volume + (means * means * precision).sum(axis=2))
        form = np.concatenate([means * precision, precision / -2], axis=2).transpose(2, 1, 0)
        return QuadraticForm(np.ascontiguousarray(form).reshape(len(form), -1), constant.T.astype(np.float32))

    def split(self) -> Mixtures:
        """Return mixtures of twice as many components: each is split into halves, which move apart along all axes."""
        step = SPLIT_STEP * np.sqrt(self.variances)
        means = np.concatenate([self.means + step, self.means - step], axis=1)
        log_weights = np.tile(self.log_weights, (1, 2)) - np.float32(np.log(2))
        return Mixtures(log_weights, means, np.tile(self.variances, (1, 2, 1)))

    def select(self, chosen: NDArray[np.intp]) -> Mixtures:
        """Return copies of the chosen densities, in the given order."""
        return Mixtures(self.log_weights[chosen], self.means[chosen], self.variances[chosen])

    def concatenate(self, other: Mixtures) -> Mixtures:
        """Return both sets of densities as one; they have equal numbers of components."""
        return Mixtures(
            np.concatenate([self.log_weights, other.log_weights]),
            np.concatenate([self.means, other.means]),
            np.concatenate([self.variances, other.variances]),
        )

    def component_sums(self, density: int, x: NDArray[np.float32], weights: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the sufficient statistics of one density's components [shape=(M, 2 D + 1)].

        x       : [shape=(N, D)], the frames in which it has a posterior
        weights : [shape=(N,)], these posteriors
        Sums of features, of squared features, and of 1, weighted by the posteriors of the component.
        """
        return self.responsibilities(density, x, weights).T @ with_squares(x)

    def set_from_statistics(
        self, densities: NDArray[np.intp], sums: NDArray[np.floating[Any]], floor: NDArray[np.floating[Any]]
    ) -> None:
        """Set weights, means and variances of densities, in place, to the maximum-likelihood estimates of statistics.

        densities : [shape=(G',)], each at most once
        sums      : [shape=(G', M, 2 D + 1)], as of ``component_sums``, with data for each density
        floor     : [shape=(D,)], least variance
        A component with less than two frames of data is switched off.
        """
        first, second = np.split(sums[:, :, :-1], 2, axis=2)
        count = sums[:, :, -1]
        enough = count >= np.minimum(2.0, count.max(axis=1, keepdims=True))
        safe = np.where(enough, count, 1)[:, :, None]
        mean = first / safe
        variance = np.maximum(second / safe - mean * mean, floor)
        weights = np.where(enough, count, 0)
        with np.errstate(divide="ignore"):
            self.log_weights[densities] = np.log(weights / weights.sum(axis=1, keepdims=True))
        self.means[densities] = np.where(enough[:, :, None], mean, 0)
        self.variances[densities] = np.where(enough[:, :, None], variance, 1)

    def map_update(self, density: int, sums: NDArray[np.floating[Any]], prior: int, relevance: float) -> None:
        """Take one maximum-a-posteriori (MAP) step of one density, in place, with another density as its prior.

        sums      : [shape=(M, 2 D + 1)], as of ``component_sums``
        prior     : the number of the density that is the prior
        relevance : weight of the prior, in frames per component
        Source: Gauvain & Lee 1994.
        """
        first, of_squares = np.split(sums[:, :-1], 2, axis=1)
        count = sums[:, -1:]
        prior_weights, mean, variance = np.exp(self.log_weights[prior]), self.means[prior], self.variances[prior]
        new_mean = (relevance * mean + first) / (relevance + count)
        second = (relevance * (variance + mean * mean) + of_squares) / (relevance + count)
        total = relevance * len(prior_weights) * prior_weights + count[:, 0]
        with np.errstate(divide="ignore"):
            self.log_weights[density] = np.log(total / total.sum())
        self.means[density] = new_mean
        self.variances[density] = np.maximum(second - new_mean * new_mean, variance / 4)

    def responsibilities(
        self, density: int, x: NDArray[np.float32], weights: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Return posteriors of a density's components, times its own [shape=(N, M)]; arguments: ``component_sums``."""
        components = self.log_components(x, np.array([density]))[:, 0]
        components -= components.max(axis=1, keepdims=True)
        posterior = np.exp(components)
        posterior *= (weights / posterior.sum(axis=1))[:, None]
        return posterior

    def copy(self) -> Mixtures:
        """Return a copy in new arrays."""
        return Mixtures(self.log_weights.copy(), self.means.copy(), self.variances.copy())


@dataclass(frozen=True, eq=False)
class QuadraticForm:
    """Log densities of components as a quadratic function of features.

    form     : coefficients of features and of their squares [shape=(2 D, M G)]
    constant : [shape=(M, G)]; G is last, for fast sums over M
    """

    form: NDArray[np.float32]
    constant: NDArray[np.float32]

    def log_components(self, x: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return log weight + log density of every component [shape=(T, M, G)]."""
        values = (np.concatenate([x, x * x], axis=1) @ self.form).reshape(len(x), *self.constant.shape)
        values += self.constant
        return values

    def log_likelihood(self, x: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the log density of every frame under every mixture [shape=(T, G)]."""
        result = np.empty((len(x), self.constant.shape[1]), np.float32)
        for start in range(0, len(x), BLOCK):
            components = self.log_components(x[start : start + BLOCK])
            if components.shape[1] == 1:
                result[start : start + BLOCK] = components[:, 0]
                continue
            best = components.max(axis=1)
            components -= best[:, None]
            np.exp(components, out=components)
            result[start : start + BLOCK] = best + np.log(components.sum(axis=1))
        return result


def normalise_components(components: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
    """Return the log density of mixtures [shape=(T, G)], and posteriors of their components [shape=(T, M, G)].

    components : log weight + log density of each [shape=(T, M, G)], overwritten by the posteriors
    With one component the posteriors, all 1, are not returned (None). Posteriors are e^``MIN_LOG_SHARE`` of the best
    one at least: products with smaller ones would be denormal, which is slow.
    """
    if components.shape[1] == 1:
        return components[:, 0], None
    best = components.max(axis=1)
    components -= best[:, None]
    np.exp(np.maximum(components, MIN_LOG_SHARE, out=components), out=components)
    total = components.sum(axis=1)
    components /= total[:, None]
    return best + np.log(total), components


def with_squares(x: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return features [shape=(T, D)], their squares, and 1, side by side [shape=(T, 2 D + 1)]."""
    return np.concatenate([x, x * x, np.ones((len(x), 1), np.float32)], axis=1)


def mixtures_from_arrays(stored: CheckedArrays) -> Mixtures:
    """Deserialise mixtures, stored as ``MIXTURES``. Raises ValueError: the weights of a density do not sum to 1."""
    total = np.exp(stored["log_weights"]).sum(axis=1)
    if not ((total > MIN_WEIGHT) & (total < MAX_WEIGHT)).all():
        raise ValueError("log_weights of a density without a Gaussian of a finite weight, or that do not sum to 1")
    return Mixtures(*(stored[name] for name in MIXTURES))
