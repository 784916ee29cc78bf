"""Acoustic context: the features around a frame, reduced to their principal components."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.storage.schema import STANDARD, ArraySpec, CheckedArrays

OFFSETS = (-24, -18, -12, -8, -4, 0, 4, 8, 12, 18, 24)
"""Frames whose features are used, relative to the frame whose motion is predicted: dense near it, 240 ms to both
sides."""
SCALE = 12.0
"""Root mean square length of a row: ridge parameters are relative to it."""
LEAST_DEVIATION = 1e-3
FEATURES = 39
INPUTS = FEATURES * len(OFFSETS)
WINDOW = {
    "window": ArraySpec(np.float32, f"2 {INPUTS}", -STANDARD, STANDARD),
    "window_basis": ArraySpec(np.float32, f"{INPUTS} A", -STANDARD, STANDARD),
}
"""How a context is stored: means above scales, and the basis."""


@dataclass(frozen=True, eq=False)
class AcousticContext:
    """Standardised features at ``OFFSETS`` around a frame, projected on their first F principal components.

    mean, scale : float32 arrays [shape=(D·len(OFFSETS),)]
    basis       : float32 array [shape=(D·len(OFFSETS), F)]
    """

    mean: NDArray[np.float32]
    scale: NDArray[np.float32]
    basis: NDArray[np.float32]

    def __call__(self, features: NDArray[np.float32], frames: NDArray[np.intp] | slice) -> NDArray[np.float32]:
        """Return the reduced features around some frames of a recording [shape=(N, F)].

        features : of the whole recording [shape=(T, D)]; beyond its ends, the first and last frame are repeated
        """
        inputs = (_surroundings(features, frames) - self.mean) / self.scale
        return np.asarray(inputs @ self.basis, np.float32)


def fit_acoustic_context(recordings: Iterable[NDArray[np.float32]], size: int) -> AcousticContext:
    """Return the acoustic context of some recordings' features [each shape=(T, D)], of ``size`` components at most."""
    count, total, products = 0, np.zeros(0), np.zeros(0)
    for features in recordings:
        rows = _surroundings(features, slice(None)).astype(float)
        if not count:
            total, products = np.zeros(rows.shape[1]), np.zeros((rows.shape[1],) * 2)
        count += len(rows)
        total += rows.sum(axis=0)
        products += rows.T @ rows
    mean = total / count
    covariance = products / count - np.outer(mean, mean)
    scale = np.sqrt(np.maximum(np.diagonal(covariance), 0)) + LEAST_DEVIATION
    _, axes = np.linalg.eigh(covariance / np.outer(scale, scale))
    basis = axes[:, ::-1][:, :size]
    basis = basis * np.where(basis[np.abs(basis).argmax(axis=0), np.arange(basis.shape[1])] < 0, -1.0, 1.0)
    factor = SCALE / np.sqrt(basis.shape[1])
    return AcousticContext(*(array.astype(np.float32) for array in (mean, scale, basis * factor)))


def acoustic_context_arrays(context: AcousticContext) -> dict[str, NDArray[Any]]:
    """Serialise a context; its basis at half precision."""
    return {"window": np.stack([context.mean, context.scale]), "window_basis": context.basis.astype(np.float16)}


def acoustic_context_from(found: CheckedArrays) -> AcousticContext:
    """Deserialise a context from arrays as ``WINDOW`` declares them. Raises ValueError: a scale that is not positive."""
    mean, scale = found["window"]
    if not (scale > 0).all():
        raise ValueError("window with a scale that is not more than 0")
    if not found["window_basis"].any(axis=0).all():
        raise ValueError("window_basis with an axis of zeros")
    return AcousticContext(mean, scale, found["window_basis"])


def _surroundings(features: NDArray[np.float32], frames: NDArray[np.intp] | slice) -> NDArray[np.float32]:
    wanted = np.arange(len(features))[frames]
    heard = np.clip(wanted[:, None] + np.array(OFFSETS), 0, len(features) - 1)
    return features[heard].reshape(len(wanted), -1)
