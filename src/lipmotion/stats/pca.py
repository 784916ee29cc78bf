"""Principal component analysis."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

EXACT_ROWS = 1500  # up to so many rows or columns all components are computed; of larger tables only the first ones
ROWS = 256  # rows of a large table that are centred at a time
SPARE_DIRECTIONS = 16  # additional directions of the iteration, which speed up its convergence
TOLERANCE, MAX_PASSES = 1e-4, 12
"""The iteration ends when a pass raises the explained variance by less than this share, or after so many passes."""
ORTHONORMAL_TOLERANCE = 0.01  # largest error of the products of a stored basis' rows
RANK_TOLERANCE = 1e-10  # components with less variance, as a share of the largest, are rounding errors
CONSTANT = 1e-12
"""Values that deviate from their mean by less than this share of the largest are constant but for rounding."""


@dataclass(frozen=True, eq=False)
class Pca:
    """Space of principal components: mean [shape=(D,)], orthonormal rows [shape=(K, D)], by falling variance."""

    mean: NDArray[np.float64]
    basis: NDArray[np.float64]

    def project(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the coordinates [shape=(T, K)] of values [shape=(T, D)]."""
        return (values - self.mean) @ self.basis.T

    def restore(self, coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values [shape=(T, D)] at coordinates [shape=(T, K)]."""
        return coordinates @ self.basis + self.mean


def fit_pca(values: NDArray[Any], components: int) -> Pca:
    """Return the first principal components of values [shape=(N, D)]; at most as many as the values span.

    The entry of each component that is furthest from 0 is positive, so equal values have equal components.
    Cost: O(N·D·min(N, D)) and min(N, D)³ up to ``EXACT_ROWS`` rows or columns; of larger tables O(N·D·components) a
    pass, with ``ROWS`` rows of memory, in single precision and up to ``TOLERANCE`` of the variance.
    """
    mean = values.mean(axis=0, dtype=np.float64)
    largest = max(float(values.max()), -float(values.min()))  # no copy of a large table
    threshold = values.size * (largest * CONSTANT) ** 2
    if min(values.shape) > EXACT_ROWS:
        return Pca(mean, _fix_signs(_iterate_subspace(values, mean, components)))
    centred = values - mean
    if values.shape[0] >= values.shape[1]:
        return Pca(mean, find_principal_axes(centred.T @ centred, components, threshold))
    squares, vectors = np.linalg.eigh(centred @ centred.T)  # XXᵀu = λu gives XᵀX(Xᵀu) = λ(Xᵀu)
    chosen = _find_largest(squares, components, threshold)
    return Pca(mean, _fix_signs((vectors[:, chosen] / np.sqrt(squares[chosen])).T @ centred))


def measure_covariance(tables: Iterable[NDArray[Any]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean [shape=(D,)] and covariance [shape=(D, D)] of the rows of tables, taken one at a time."""
    count, total, products = 0, np.float64(0), np.float64(0)
    for rows in (table.astype(float) for table in tables):
        count, total, products = count + len(rows), total + rows.sum(axis=0), products + rows.T @ rows
    mean = np.asarray(total / count)
    return mean, products / count - np.outer(mean, mean)


def find_principal_axes(products: NDArray[np.float64], components: int, threshold: float = 0.0) -> NDArray[np.float64]:
    """Return the first principal components [shape=(K, D)] of centred values X, given XᵀX or their covariance.

    products : [shape=(D, D)];  threshold : largest eigenvalue that rounding alone may produce
    """
    squares, vectors = np.linalg.eigh(products)
    return _fix_signs(vectors[:, _find_largest(squares, components, threshold)].T)


def _fix_signs(basis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return components [shape=(K, D)] with signs such that the entry furthest from 0 is positive."""
    signs = np.sign(basis[np.arange(len(basis)), np.abs(basis).argmax(axis=1)])
    return basis * signs[:, None]


def check_orthonormal(name: str, basis: NDArray[Any]) -> None:
    """Raise ValueError unless the rows of a basis [shape=(K, D)] are orthonormal."""
    worst = float(np.abs(basis @ basis.T - np.eye(len(basis))).max())
    if not worst <= ORTHONORMAL_TOLERANCE:
        raise ValueError(f"{name} of rows that are not orthonormal (products {worst:g} off)")


def _find_largest(squares: NDArray[np.float64], count: int, threshold: float) -> NDArray[np.intp]:
    """Return the indices of the largest of ascending numbers, without rounding errors, up to ``threshold``."""
    indices = np.arange(len(squares))[::-1][:count]
    return indices[squares[indices] > max(RANK_TOLERANCE * squares[-1], threshold)]


def _iterate_subspace(values: NDArray[Any], mean: NDArray[np.float64], components: int) -> NDArray[np.float64]:
    """Return the first components of a large table [shape=(K, D)] (Halko, Martinsson & Tropp 2011, §4.5 and §5.1)."""
    size = min(components + SPARE_DIRECTIONS, *values.shape)
    start = values[choose_evenly(size, len(values))] - mean
    directions = np.linalg.qr(start.T.astype(np.float32))[0]
    variance, centre = 0.0, mean.astype(np.float32)
    for _ in range(MAX_PASSES):
        product = np.zeros_like(directions)  # XᵀX · directions, in blocks of rows
        for first in range(0, len(values), ROWS):
            rows = values[first : first + ROWS] - centre
            product += rows.T @ (rows @ directions)
        squares, rotation = np.linalg.eigh((directions.T @ product).astype(np.float64))
        before, variance = variance, float(squares[-components:].sum())
        if variance - before <= TOLERANCE * variance:
            break
        directions = np.linalg.qr(product)[0]
    return (directions @ rotation[:, ::-1][:, :components].astype(np.float32)).T.astype(np.float64)


def choose_evenly(count: int, total: int) -> NDArray[np.intp]:
    """Return ``count`` of ``total`` indices, evenly spaced [shape=(min(count, total),)]."""
    count = min(count, total)
    return ((np.arange(count) + 0.5) * total / max(count, 1)).astype(np.intp)
