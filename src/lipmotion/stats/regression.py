"""Linear regressions along decision trees: each node's is drawn towards that of the node above it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.stats.trees import Tree

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RegressionStatistics:
    """Sums over frames of inputs z [shape=(F,)] and what they should explain, r [shape=(P,)]; they grow in place.

    products : Σ z zᵀ [shape=(F, F)]
    targets  : Σ z rᵀ [shape=(F, P)]
    """

    products: Array
    targets: Array

    def add(self, z: NDArray[np.floating[Any]], r: NDArray[np.floating[Any]]) -> None:
        """Take in frames [shapes=(N, F), (N, P)]."""
        np.add(self.products, z.T @ z, out=self.products)
        np.add(self.targets, z.T @ r, out=self.targets)

    def __add__(self, other: RegressionStatistics) -> RegressionStatistics:
        return RegressionStatistics(self.products + other.products, self.targets + other.targets)


def zero_statistics(inputs: int, outputs: int) -> RegressionStatistics:
    """Return the sums over no frames."""
    return RegressionStatistics(np.zeros((inputs, inputs)), np.zeros((inputs, outputs)))


def ridge(moments: RegressionStatistics, prior: Array, strength: float) -> Array:
    """Return the coefficients [shape=(F, P)] that explain the targets best, near those expected beforehand.

    prior    : [shape=(F, P)]
    strength : how many squared units of z the prior counts for
    argmin Σ |r - Cᵀz|² + strength |C - prior|²
    """
    system = moments.products + strength * np.eye(len(moments.products))
    return prior + np.linalg.solve(system, moments.targets - moments.products @ prior).astype(float)


def regression_node(tree: Tree, path: list[int], least: float) -> int:
    """Return the last node on the way to a leaf that has enough frames for a regression of its own, or the root."""
    return next((node for node in reversed(path) if tree.frames[node] >= least), 0)


def fit_tree_regressions(
    tree: Tree, moments: Mapping[int, RegressionStatistics], shared: Array, strength: float
) -> dict[int, Array]:
    """Return the coefficients of every owner [shape=(F, P)]: each node's are drawn towards those of the one above.

    moments : of the frames of the leaves that each owner stands for
    shared  : what the root's are drawn towards
    """
    found: dict[int, Array] = {}

    def visit(node: int, end: int, prior: Array) -> None:
        inside = [moments[owned] for owned in moments if node <= owned < end]
        if not inside:
            return
        coefficients = ridge(sum(inside[1:], inside[0]), prior, strength)
        if node in moments:
            found[node] = coefficients
        if tree.asked[node] >= 0:
            visit(node + 1, int(tree.no[node]), coefficients)
            visit(int(tree.no[node]), end, coefficients)

    visit(0, len(tree.asked), shared)
    return found
