"""Principal components."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


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


def fit_pca(values: NDArray[np.float64], components: int) -> Pca:
    """Return the first principal components of values [shape=(N, D)]; at most D of them."""
    mean = values.mean(axis=0)
    centred = values - mean
    _, vectors = np.linalg.eigh(centred.T @ centred)
    basis = vectors[:, ::-1][:, : min(components, values.shape[1])].T
    signs = np.sign(basis[np.arange(len(basis)), np.abs(basis).argmax(axis=1)])
    return Pca(mean, basis * signs[:, None])
