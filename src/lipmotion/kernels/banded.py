"""Parameter generation: the smooth trajectory behind means and precisions of it, its slope and its curvature."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bands = tuple[Array, Array, Array, Array]
"""Main, first and second diagonal of a symmetric system per channel, and its right-hand side, all (T, P)."""


def normal_equations(mean: Array, precision: Array) -> Bands:
    """Return the system W'PW x = W'P m of maximum-likelihood parameter generation.

    mean, precision : [shape=(T, 3, P)], of the static value, Δ = (-½, 0, ½) and Δ² = (1, -2, 1)
    Dynamic rows that stick out at the ends have no precision.
    Source: Hofer 2008, Eqs. 6–11 (the print's Δ² lost its minus sign).
    """
    p0, p1, p2 = (np.array(precision[:, window], float) for window in range(3))
    p1[[0, -1]] = 0
    p2[[0, -1]] = 0
    w0, w1, w2 = p0 * mean[:, 0], p1 * mean[:, 1], p2 * mean[:, 2]
    main = p0 + 4 * p2
    main[1:] += 0.25 * p1[:-1] + p2[:-1]
    main[:-1] += 0.25 * p1[1:] + p2[1:]
    first, second = np.zeros_like(main), np.zeros_like(main)
    first[:-1] = -2 * (p2[:-1] + p2[1:])
    second[:-2] = p2[1:-1] - 0.25 * p1[1:-1]
    right = w0 - 2 * w2
    right[1:] += 0.5 * w1[:-1] + w2[:-1]
    right[:-1] += -0.5 * w1[1:] + w2[1:]
    return main, first, second, right


def pin(bands: Bands, frame: int, channel: int, value: float) -> None:
    """Make the solution take ``value`` in one frame of one channel, exactly (in place; once for each)."""
    main, first, second, right = bands
    for reach, diagonal in ((1, first), (2, second)):
        if frame >= reach:
            right[frame - reach, channel] -= diagonal[frame - reach, channel] * value
            diagonal[frame - reach, channel] = 0
        if frame + reach < len(main):
            right[frame + reach, channel] -= diagonal[frame, channel] * value
        diagonal[frame, channel] = 0
    main[frame, channel], right[frame, channel] = 1, value


def solve(bands: Bands) -> tuple[Array, Array]:
    """Return the solution and the diagonal of the inverse (the posterior variance), both [shape=(T, P)].

    Cost: O(T·P): LDLᵀ over time, all channels at once; the diagonal by the recursion of Takahashi et al. 1973.
    """
    main, first, second, right = bands
    pivot, lower1, lower2, x = np.empty_like(main), np.zeros_like(main), np.zeros_like(main), np.empty_like(main)
    for t in range(len(main)):
        pivot[t], x[t] = main[t], right[t]
        coupling = first[t].copy()
        if t:
            scaled = lower1[t - 1] * pivot[t - 1]
            pivot[t] -= scaled * lower1[t - 1]
            coupling -= scaled * lower2[t - 1]
            x[t] -= lower1[t - 1] * x[t - 1]
        if t > 1:
            pivot[t] -= lower2[t - 2] * lower2[t - 2] * pivot[t - 2]
            x[t] -= lower2[t - 2] * x[t - 2]
        lower1[t] = coupling / pivot[t]
        lower2[t] = second[t] / pivot[t]
    x /= pivot
    variance = 1 / pivot
    beside = np.zeros_like(main)  # inverse between t and t + 1
    for t in range(len(main) - 2, -1, -1):
        x[t] -= lower1[t] * x[t + 1]
        across = -lower1[t] * variance[t + 1]
        beside[t] = across
        variance[t] -= lower1[t] * across
        if t + 2 < len(main):
            x[t] -= lower2[t] * x[t + 2]
            beside[t] -= lower2[t] * beside[t + 1]
            far = -lower1[t] * beside[t + 1] - lower2[t] * variance[t + 2]
            variance[t] += lower1[t] * lower2[t] * beside[t + 1] - lower2[t] * far
    return x, variance
