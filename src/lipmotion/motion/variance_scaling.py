"""Variance scaling: parameter generation alone makes movements smaller than the recorded ones.

Source: Silén, Helander, Nurminen & Gabbouj 2012. Deviation: scaling is about the rest pose, not about the mean, so that
a closed mouth stays closed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

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


class VarianceScaling(NamedTuple):
    """By how much movements away from the rest pose grow, dimension by dimension.

    factors, rest : from ``scaling_factors``, and the rest pose [shape=(Q,)]
    """

    factors: Array
    rest: Array

    def apply(self, means: Array, precisions: Array) -> tuple[Array, Array]:
        """Return the means and precisions of the larger movements.

        means, precisions : of static value, Δ and Δ² [shape=(T, 3, Q)]
        """
        grown = means * self.factors
        grown[:, 0] += self.rest * (1 - self.factors)
        return grown, precisions / (self.factors * self.factors)
