"""Dynamic features: static values with Δ (slope) and Δ² (curvature)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def with_dynamics(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return each value with its Δ = (-½, 0, ½) and Δ² = (1, -2, 1) [shape=(T, 3, P)].

    values : [shape=(T, P)]
    Δ and Δ² of the first and last frame, which need frames outside, are 0; parameter generation gives them no weight.
    Source: Hofer 2008, Eqs. 6–8 (the print's Δ² lost its minus sign).
    """
    dynamics = np.zeros((len(values), 3, values.shape[1]))
    dynamics[:, 0] = values
    dynamics[1:-1, 1] = (values[2:] - values[:-2]) / 2
    dynamics[1:-1, 2] = values[2:] - 2 * values[1:-1] + values[:-2]
    return dynamics


def mark_known_dynamics(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return where Δ and Δ² are known [shape=(T,)]: in frames that are known with both neighbours.

    mask : where the static values are known [shape=(T,)]
    """
    inner = np.zeros_like(mask)
    inner[1:-1] = mask[:-2] & mask[1:-1] & mask[2:]
    return inner
