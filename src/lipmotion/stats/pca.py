"""Principal components."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

EXACT = 1500
"""Up to so many rows or columns all components are computed, and the first are kept; of larger tables only those."""
ROWS = 256
"""Rows of a large table that are centred at a time."""
SPARE = 16
"""Directions that are searched beside those that are wanted: they make the search converge."""
TOLERANCE, MOST_PASSES = 1e-4, 12
"""The search ends when a pass over the table adds less than this share of the variance found, or after so many."""
ORTHONORMAL = 0.01
"""Rows of a stored basis are orthonormal but for rounding."""
RANK_TOLERANCE = 1e-10
"""Components with less than this share of the largest one's variance are rounding."""
CONSTANT = 1e-12
"""Values that deviate from their mean by less than this share of the largest do so by rounding."""


@dataclass(frozen=True, eq=False)
class Pca:
    """An affine space of few dimensions.

    mean  : [shape=(D,)]
    basis : [shape=(K, D)], orthonormal rows, most variance first
    """

    mean: NDArray[np.float64]
    basis: NDArray[np.float64]

    def project(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the coordinates [shape=(T, K)] of values [shape=(T, D)]."""
        return (values - self.mean) @ self.basis.T

    def restore(self, coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values [shape=(T, D)] at coordinates [shape=(T, K)]."""
        return coordinates @ self.basis + self.mean


def fit_pca(values: NDArray[Any], components: int) -> Pca:
    """Return the first principal components of numbers [shape=(N, D)]; no more than the numbers span.

    The entry of each that is the furthest from 0 is positive, so the same values have the same components.
    Cost: O(N·D·min(N, D)) and min(N, D)³ up to ``EXACT`` rows or columns; of larger tables O(N·D·components) a pass,
    with ``ROWS`` rows of memory, in single precision and up to ``TOLERANCE`` of the variance.
    """
    mean = values.mean(axis=0, dtype=np.float64)
    largest = max(float(values.max()), -float(values.min()))  # no copy of a large table
    least = values.size * (largest * CONSTANT) ** 2
    if min(values.shape) > EXACT:
        basis = _leading(values, mean, components)
    elif values.shape[0] < values.shape[1]:
        basis = _of_rows(values - mean, components, least)
    else:
        basis = _of_columns(values - mean, components, least)
    signs = np.sign(basis[np.arange(len(basis)), np.abs(basis).argmax(axis=1)])
    return Pca(mean, basis * signs[:, None])


def _of_columns(centred: NDArray[np.float64], components: int, least: float) -> NDArray[np.float64]:
    squares, vectors = np.linalg.eigh(centred.T @ centred)
    return vectors[:, _largest(squares, components, least)].T


def check_orthonormal(name: str, basis: NDArray[Any]) -> None:
    """Raise ValueError unless the rows of a basis [shape=(K, D)] are orthonormal."""
    worst = float(np.abs(basis @ basis.T - np.eye(len(basis))).max())
    if not worst <= ORTHONORMAL:
        raise ValueError(f"{name} of rows that are not orthonormal (products {worst:g} off)")


def _of_rows(centred: NDArray[np.float64], components: int, least: float) -> NDArray[np.float64]:
    """Return the same from the products of N < D rows: XXᵀu = λu gives XᵀX(Xᵀu) = λ(Xᵀu)."""
    squares, vectors = np.linalg.eigh(centred @ centred.T)
    kept = _largest(squares, components, least)
    return (vectors[:, kept] / np.sqrt(squares[kept])).T @ centred


def _largest(squares: NDArray[np.float64], count: int, least: float) -> NDArray[np.intp]:
    """Return the places of the largest of rising numbers, without those that are rounding: their directions are chance.

    least : what rounding alone may make of them
    """
    places = np.arange(len(squares))[::-1][:count]
    return places[squares[places] > max(RANK_TOLERANCE * squares[-1], least)]


def _leading(values: NDArray[Any], mean: NDArray[np.float64], components: int) -> NDArray[np.float64]:
    """Return the first components of a large table by block power iteration from some of its own rows.

    Source: Halko, Martinsson & Tropp 2011, §4.5 (subspace iteration) and §5.1; Rayleigh-Ritz at its end.
    """
    size = min(components + SPARE, *values.shape)
    start = values[evenly_spaced(size, len(values))] - mean
    directions = np.linalg.qr(start.T.astype(np.float32))[0]
    found = 0.0
    for _ in range(MOST_PASSES):
        product = _covariance_times(values, mean, directions)
        squares, turn = np.linalg.eigh((directions.T @ product).astype(np.float64))
        before, found = found, float(squares[-components:].sum())
        if found - before <= TOLERANCE * found:
            break
        directions = np.linalg.qr(product)[0]
    return (directions @ turn[:, ::-1][:, :components].astype(np.float32)).T.astype(np.float64)


def _covariance_times(
    values: NDArray[Any], mean: NDArray[np.float64], directions: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return XᵀXQ of the centred X, which is never whole in memory."""
    total, centre = np.zeros_like(directions), mean.astype(np.float32)
    for start in range(0, len(values), ROWS):
        rows = values[start : start + ROWS] - centre
        total += rows.T @ (rows @ directions)
    return total


def evenly_spaced(count: int, total: int) -> NDArray[np.intp]:
    """Return ``count`` of ``total`` places, evenly spread [shape=(min(count, total),)]."""
    count = min(count, total)
    return ((np.arange(count) + 0.5) * total / max(count, 1)).astype(np.intp)
