"""Variance scaling: parameter generation alone makes movements smaller than the recorded ones.

Source: Silén, Helander, Nurminen & Gabbouj 2012. Deviation: scaling is about the rest pose, not about the mean, so that
a closed mouth stays closed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LARGEST_FACTOR = 2.0
"""A dimension that hardly follows speech is not scaled further."""
LEAST_DEVIATION = 1e-6


def scaling_factors(recorded: Sequence[Array], generated: Sequence[Array]) -> Array:
    """Return the factors by which generated movements have to grow to vary as much as recorded ones [shape=(Q,)].

    recorded, generated : standard deviations within each clip [each shape=(Q,)]; at least one clip
    The mean over clips of the one divided by that of the other, from 1 to ``LARGEST_FACTOR``.
    """
    ratio = np.mean(recorded, axis=0) / np.maximum(np.mean(generated, axis=0), LEAST_DEVIATION)
    return np.clip(ratio, 1.0, LARGEST_FACTOR)


def scaled(means: Array, precisions: Array, factors: Array, rest: Array) -> tuple[Array, Array]:
    """Return means and precisions of movements away from the rest pose that are larger by some factors.

    means, precisions : of static value, Δ and Δ² [shape=(T, 3, Q)]
    factors, rest     : from ``scaling_factors``, and the rest pose [shape=(Q,)]
    """
    grown = means * factors
    grown[:, 0] += rest * (1 - factors)
    return grown, precisions / (factors * factors)
