"""Linear regressions in decision trees: that of each node has the regression of the node above as its prior."""

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
    """Sufficient statistics of a regression of targets r [shape=(P,)] on inputs z [shape=(F,)]; accumulated in place.

    products : Σ z zᵀ [shape=(F, F)]
    targets  : Σ z rᵀ [shape=(F, P)]
    """

    products: Array
    targets: Array

    def add(self, z: NDArray[np.floating[Any]], r: NDArray[np.floating[Any]]) -> None:
        """Accumulate the statistics of frames [shapes=(N, F), (N, P)]."""
        np.add(self.products, z.T @ z, out=self.products)
        np.add(self.targets, z.T @ r, out=self.targets)

    def __add__(self, other: RegressionStatistics) -> RegressionStatistics:
        return RegressionStatistics(self.products + other.products, self.targets + other.targets)


def zero_statistics(inputs: int, outputs: int) -> RegressionStatistics:
    """Return zero statistics."""
    return RegressionStatistics(np.zeros((inputs, inputs)), np.zeros((inputs, outputs)))


def ridge(moments: RegressionStatistics, prior: Array, strength: float) -> Array:
    """Return the coefficients of a ridge regression towards a prior [shape=(F, P)].

    prior    : coefficients [shape=(F, P)]
    strength : weight of the prior, in squared units of z
    argmin Σ |r - Cᵀz|² + strength |C - prior|²
    """
    system = moments.products + strength * np.eye(len(moments.products))
    return prior + np.linalg.solve(system, moments.targets - moments.products @ prior).astype(float)


def fit_regression_node(tree: Tree, path: list[int], least: float) -> int:
    """Return the last node of a path that has at least ``least`` frames, enough for its own regression; or the root."""
    return next((node for node in reversed(path) if tree.frames[node] >= least), 0)


def fit_tree_regressions(
    tree: Tree, moments: Mapping[int, RegressionStatistics], shared: Array, strength: float
) -> dict[int, Array]:
    """Return the coefficients of every node in ``moments`` [shape=(F, P)]; each has those of the node above as prior.

    moments : by node, the statistics of the leaves whose regression is that of the node (``fit_regression_node``)
    shared  : the prior of the root
    """
    regressions: dict[int, Array] = {}

    def visit(node: int, end: int, prior: Array) -> None:
        inside = [moments[other] for other in moments if node <= other < end]
        if not inside:
            return
        coefficients = ridge(sum(inside[1:], inside[0]), prior, strength)
        if node in moments:
            regressions[node] = coefficients
        if tree.asked[node] >= 0:
            visit(node + 1, int(tree.no[node]), coefficients)
            visit(int(tree.no[node]), end, coefficients)

    visit(0, len(tree.asked), shared)
    return regressions
