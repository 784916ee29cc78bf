"""Acoustic context: the features around a frame, reduced to their principal components."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.stats.pca import find_principal_axes, measure_covariance
from lipmotion.storage.schema import LARGEST_MEAN, ArraySpec, CheckedArrays

OFFSETS = (-24, -18, -12, -8, -4, 0, 4, 8, 12, 18, 24)
"""Frames whose features are used, relative to the predicted one: up to 240 ms before and after, denser near it."""
SCALE = 12.0  # root mean square length of a reduced feature vector: ridge parameters are relative to it
MIN_DEVIATION = 1e-3  # added to the standard deviation of every input, so that constant inputs can be standardised
FEATURES = 39
INPUTS = FEATURES * len(OFFSETS)
WINDOW = {
    "window": ArraySpec(np.float32, f"2 {INPUTS}", -LARGEST_MEAN, LARGEST_MEAN),
    "window_basis": ArraySpec(np.float32, f"{INPUTS} A", -LARGEST_MEAN, LARGEST_MEAN),
}
"""Arrays of an acoustic context: ``window`` holds the means in its first row and the scales in its second."""


@dataclass(frozen=True, eq=False)
class AcousticContext:
    """Standardised features at ``OFFSETS`` around a frame, projected on their first F principal components."""

    mean: NDArray[np.float32]  # of the standardisation [shape=(D·len(OFFSETS),)]
    scale: NDArray[np.float32]  # of the same [shape=(D·len(OFFSETS),)]
    basis: NDArray[np.float32]  # [shape=(D·len(OFFSETS), F)]

    def __call__(self, features: NDArray[np.float32], frames: NDArray[np.intp] | slice) -> NDArray[np.float32]:
        """Return the reduced features around some frames of a recording [shape=(N, F)]; beyond its ends they repeat."""
        inputs = (_stack(features, frames) - self.mean) / self.scale
        return np.asarray(inputs @ self.basis, np.float32)


def fit_acoustic_context(recordings: Iterable[NDArray[np.float32]], size: int) -> AcousticContext:
    """Return the first ``size`` principal components, or all, of acoustic features [each shape=(T, D)]."""
    mean, covariance = measure_covariance(_stack(features, slice(None)) for features in recordings)
    scale = np.sqrt(np.maximum(np.diagonal(covariance), 0)) + MIN_DEVIATION
    axes = find_principal_axes(covariance / np.outer(scale, scale), size)
    basis = np.ascontiguousarray(axes.T)  # stored in this order
    factor = SCALE / np.sqrt(basis.shape[1])
    return AcousticContext(*(array.astype(np.float32) for array in (mean, scale, basis * factor)))


def acoustic_context_to_arrays(context: AcousticContext) -> dict[str, NDArray[Any]]:
    """Serialise a context; the basis is stored at half precision."""
    return {"window": np.stack([context.mean, context.scale]), "window_basis": context.basis.astype(np.float16)}


def acoustic_context_from_arrays(arrays: CheckedArrays) -> AcousticContext:
    """Deserialise a context from checked arrays. Raises ValueError: a scale not positive, or a column of zeros."""
    mean, scale = arrays["window"]
    if not (scale > 0).all():
        raise ValueError("window with a scale that is not more than 0")
    if not arrays["window_basis"].any(axis=0).all():
        raise ValueError("window_basis with an axis of zeros")
    return AcousticContext(mean, scale, arrays["window_basis"])


def _stack(features: NDArray[np.float32], frames: NDArray[np.intp] | slice) -> NDArray[np.float32]:
    """Return the features at ``OFFSETS`` around some frames, concatenated [shape=(N, D·len(OFFSETS))]."""
    centres = np.arange(len(features))[frames]
    indices = np.clip(centres[:, None] + np.array(OFFSETS), 0, len(features) - 1)
    return features[indices].reshape(len(centres), -1)
