"""Variance scaling: generated movements are made as large as recorded ones; parameter generation alone damps them.

Source: Silén, Helander, Nurminen & Gabbouj 2012. Deviation: scaling is about the rest pose, not about the mean, so that
a closed mouth stays closed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LARGEST_FACTOR = 2.0
"""No factor is larger: a dimension that hardly depends on speech would be scaled too far."""
MIN_DEVIATION = 1e-6


def fit_scaling_factors(recorded: Sequence[NDArray[Any]], generated: Sequence[Array]) -> Array:
    """Return the factors by which generated movements are scaled to vary as much as recorded ones [shape=(Q,)].

    recorded, generated : motion of each clip [each shape=(T_i, Q)]; at least one clip
    A factor is the mean over clips of the recorded standard deviations divided by that of the generated ones, from 1 to
    ``LARGEST_FACTOR``.
    """
    wanted, made = (np.mean([clip.std(axis=0) for clip in clips], axis=0) for clips in (recorded, generated))
    ratio = wanted / np.maximum(made, MIN_DEVIATION)
    return np.clip(ratio, 1.0, LARGEST_FACTOR)


class VarianceScaling(NamedTuple):
    """Factors by which movements away from the rest pose are scaled, dimension by dimension.

    factors : from ``fit_scaling_factors`` [shape=(Q,)]
    rest    : the rest pose [shape=(Q,)]
    """

    factors: Array
    rest: Array

    def apply(self, means: Array, precisions: Array) -> tuple[Array, Array]:
        """Return means and precisions of the scaled movements [each shape=(T, 3, Q)].

        means, precisions : of static value, Δ and Δ² [each shape=(T, 3, Q)]
        """
        scaled = means * self.factors
        scaled[:, 0] += self.rest * (1 - self.factors)
        return scaled, precisions / (self.factors * self.factors)
