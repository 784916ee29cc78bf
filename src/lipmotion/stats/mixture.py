"""Mixtures of diagonal Gaussians, many densities at a time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.storage.schema import LARGEST_VARIANCE, POSITIVE, STANDARD, ArraySpec, CheckedArrays

SPLIT_STEP = 0.2
"""Halves of a split component move apart by this many standard deviations."""
BLOCK = 256
"""Frames whose components are computed at a time: they fit into the cache."""
LEAST_LOG_SHARE = np.float32(-50)
LOG_2PI = float(np.log(2 * np.pi))
MIXTURES = {
    "log_weights": ArraySpec(np.float32, "G M", -np.inf, 0.1),
    "means": ArraySpec(np.float32, "G M D", -STANDARD, STANDARD),
    "variances": ArraySpec(np.float32, "G M D", POSITIVE, LARGEST_VARIANCE),
}
"""Of standardised values; weights may be rounded to half precision."""
LEAST_WEIGHT, MOST_WEIGHT = 0.5, 1.5
"""The weights of a density sum to 1 but for rounding."""


@dataclass(frozen=True, eq=False)
class Mixtures:
    """G mixture densities of M diagonal Gaussians each.

    log_weights : float32 array [shape=(G, M)], -inf marks an unused component
    means, variances : float32 arrays [shape=(G, M, D)]
    """

    log_weights: NDArray[np.float32]
    means: NDArray[np.float32]
    variances: NDArray[np.float32]

    @property
    def size(self) -> tuple[int, int, int]:
        """G, M and D."""
        G, M, D = self.means.shape
        return G, M, D

    def log_components(self, x: NDArray[np.float32], chosen: NDArray[np.intp] | None = None) -> NDArray[np.float32]:
        """Return log weight + log density of every component [shape=(T, G', M)].

        x      : [shape=(T, D)]
        chosen : [shape=(G',)], the densities wanted; all by default
        Cost: O(T·G'·M·D), as one matrix product.
        """
        return self.quadratic(chosen).log_components(x).transpose(0, 2, 1)

    def log_likelihood(self, x: NDArray[np.float32], chosen: NDArray[np.intp] | None = None) -> NDArray[np.float32]:
        """Return the log density of every frame under every mixture [shape=(T, G')]."""
        form = self.quadratic(chosen)
        result = np.empty((len(x), form.constant.shape[1]), np.float32)
        for start in range(0, len(x), BLOCK):
            components = form.log_components(x[start : start + BLOCK])
            if components.shape[1] == 1:
                result[start : start + BLOCK] = components[:, 0]
                continue
            best = components.max(axis=1)
            components -= best[:, None]
            np.exp(components, out=components)
            result[start : start + BLOCK] = best + np.log(components.sum(axis=1))
        return result

    def quadratic(self, chosen: NDArray[np.intp] | None = None) -> QuadraticForm:
        """Return the densities [shape=(G',)] as one matrix; all by default."""
        pick = slice(None) if chosen is None else chosen
        means, precision = self.means[pick], 1 / self.variances[pick]
        constant = self.log_weights[pick] - 0.5 * (
            means.shape[2] * LOG_2PI - np.log(precision).sum(axis=2) + (means * means * precision).sum(axis=2)
        )
        form = np.concatenate([means * precision, precision / -2], axis=2).transpose(2, 1, 0)
        return QuadraticForm(np.ascontiguousarray(form).reshape(len(form), -1), constant.T.astype(np.float32))

    def split(self) -> Mixtures:
        """Return twice as many components, each half moved apart along all axes."""
        step = SPLIT_STEP * np.sqrt(self.variances)
        return Mixtures(
            np.concatenate([self.log_weights, self.log_weights], axis=1) - np.float32(np.log(2)),
            np.concatenate([self.means + step, self.means - step], axis=1),
            np.concatenate([self.variances, self.variances], axis=1),
        )

    def picked(self, chosen: NDArray[np.intp]) -> Mixtures:
        """Return copies of some densities, in the order given."""
        return Mixtures(self.log_weights[chosen], self.means[chosen], self.variances[chosen])

    def joined(self, other: Mixtures) -> Mixtures:
        """Return both sets of densities, which have as many components each."""
        return Mixtures(
            np.concatenate([self.log_weights, other.log_weights]),
            np.concatenate([self.means, other.means]),
            np.concatenate([self.variances, other.variances]),
        )

    def improve(
        self, density: int, x: NDArray[np.float32], share: NDArray[np.float32], floor: NDArray[np.float32]
    ) -> None:
        """Take one EM step of one density, in place (training works on a ``copy``).

        x     : [shape=(N, D)], the frames it accounts for
        share : [shape=(N,)], their state posteriors
        floor : [shape=(D,)], least variance
        A component with less than two frames' worth of data is switched off.
        """
        posterior = self.responsibilities(density, x, share)
        count, first, second = posterior.sum(axis=0), posterior.T @ x, posterior.T @ (x * x)
        self.estimate(np.array([density]), count[None], first[None], second[None], floor)

    def estimate(
        self,
        densities: NDArray[np.intp],
        count: NDArray[np.floating[Any]],
        first: NDArray[np.floating[Any]],
        second: NDArray[np.floating[Any]],
        floor: NDArray[np.float32],
    ) -> None:
        """Give densities the weights, means and variances that explain sums over their frames best.

        densities     : [shape=(G',)], each once
        count         : [shape=(G', M)], of the posteriors of each component; some of each density
        first, second : [shape=(G', M, D)], of the features and of their squares, times the posteriors
        floor         : [shape=(D,)], least variance
        A component with less than two frames' worth of data is switched off.
        """
        alive = count >= np.minimum(2.0, count.max(axis=1, keepdims=True))
        safe = np.where(alive, count, 1)[:, :, None]
        mean = first / safe
        variance = np.maximum(second / safe - mean * mean, floor)
        weights = np.where(alive, count, 0)
        with np.errstate(divide="ignore"):
            self.log_weights[densities] = np.log(weights / weights.sum(axis=1, keepdims=True))
        self.means[densities] = np.where(alive[:, :, None], mean, 0)
        self.variances[densities] = np.where(alive[:, :, None], variance, 1)

    def adapt(
        self, density: int, x: NDArray[np.float32], share: NDArray[np.float32], prior: int, relevance: float
    ) -> None:
        """Take one maximum-a-posteriori step of one density towards its data, from another one as its prior.

        x, share  : as in ``improve``
        prior     : the density that counts as much as ``relevance`` frames a component
        Source: Gauvain & Lee 1994, with the prior's own shape as its certainty.
        """
        posterior = self.responsibilities(density, x, share)
        count = posterior.sum(axis=0)[:, None]
        weight, mean, variance = np.exp(self.log_weights[prior]), self.means[prior], self.variances[prior]
        new_mean = (relevance * mean + posterior.T @ x) / (relevance + count)
        second = (relevance * (variance + mean * mean) + posterior.T @ (x * x)) / (relevance + count)
        weights = relevance * len(weight) * weight + count[:, 0]
        with np.errstate(divide="ignore"):
            self.log_weights[density] = np.log(weights / weights.sum())
        self.means[density] = new_mean
        self.variances[density] = np.maximum(second - new_mean * new_mean, variance / 4)

    def responsibilities(self, density: int, x: NDArray[np.float32], share: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return each frame's share divided between the components of one density [shape=(N, M)].

        x, share : as in ``improve``
        """
        components = self.log_components(x, np.array([density]))[:, 0]
        components -= components.max(axis=1, keepdims=True)
        posterior = np.exp(components)
        posterior *= (share / posterior.sum(axis=1))[:, None]
        return posterior

    def copy(self) -> Mixtures:
        """Return the same mixtures in arrays of their own."""
        return replace(
            self, log_weights=self.log_weights.copy(), means=self.means.copy(), variances=self.variances.copy()
        )


@dataclass(frozen=True, eq=False)
class QuadraticForm:
    """Mixtures as what features and their squares are multiplied by.

    form     : [shape=(2 D, M G)]
    constant : [shape=(M, G)], what is added; G last, for sums over M run along memory
    """

    form: NDArray[np.float32]
    constant: NDArray[np.float32]

    def log_components(self, x: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return log weight + log density of every component [shape=(T, M, G)]."""
        values = (np.concatenate([x, x * x], axis=1) @ self.form).reshape(len(x), *self.constant.shape)
        values += self.constant
        return values

    def divided(self, features: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
        """Return the log density of every mixture [shape=(T, G)], and its components' shares of it [shape=(T, M, G)].

        features : ``with_squares`` of what the densities are of
        """
        whole = np.concatenate([self.form, self.constant.reshape(1, -1)])
        shares = (features @ whole).reshape(len(features), *self.constant.shape)
        return normalised_components(shares)


def normalised_components(
    components: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
    """Return the log density of mixtures [shape=(T, G)], and their components' shares of it [shape=(T, M, G)].

    components : log weight + log density of each [shape=(T, M, G)], changed in place
    Of a single component the share is 1, and not told (None). Shares under e^``LEAST_LOG_SHARE`` are not told apart:
    in products smaller ones would be denormal, and slow.
    """
    if components.shape[1] == 1:
        return components[:, 0], None
    best = components.max(axis=1)
    components -= best[:, None]
    np.exp(np.maximum(components, LEAST_LOG_SHARE, out=components), out=components)
    total = components.sum(axis=1)
    components /= total[:, None]
    return best + np.log(total), components


def with_squares(x: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return features [shape=(T, D)], their squares and 1: what densities, and sums over frames, are products of."""
    return np.concatenate([x, x * x, np.ones((len(x), 1), np.float32)], axis=1)


def equal_gaussians(x: NDArray[np.float32], count: int) -> Mixtures:
    """Return ``count`` equal single Gaussians with the mean and variance of ``x`` (the flat start)."""
    mean, variance = x.mean(axis=0), np.maximum(x.var(axis=0), 1e-4)
    return Mixtures(
        np.zeros((count, 1), np.float32),
        np.tile(mean, (count, 1, 1)).astype(np.float32),
        np.tile(variance, (count, 1, 1)).astype(np.float32),
    )


def mixtures_from_arrays(found: CheckedArrays) -> Mixtures:
    """Return mixtures, stored as ``MIXTURES`` says. Raises ValueError: the weights of one do not sum to 1."""
    total = np.exp(found["log_weights"]).sum(axis=1)
    if not ((total > LEAST_WEIGHT) & (total < MOST_WEIGHT)).all():
        raise ValueError("log_weights of a density without a Gaussian of a finite weight, or that do not sum to 1")
    return Mixtures(*(found[name] for name in MIXTURES))
