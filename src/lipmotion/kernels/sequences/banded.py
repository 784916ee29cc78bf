"""Maximum-likelihood parameter generation: the trajectory of Gaussians of static values, Δ and Δ²."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.choice import compiled_pays

Array = NDArray[np.float64]
Bands = tuple[Array, Array, Array, Array]
"""Main, first and second diagonal of the symmetric system of each channel, and its right-hand side [shapes=(T, P)]."""
Rows = list[Any]
"""A row of each frame: an array of the channels [shape=(P,)], or a number."""
FRAME_S = 12e-6
"""Time that NumPy takes for a frame, with up to some 90 channels (docs/results/kernels.md)."""


def generate(mean: Array, precision: Array, pins: Mapping[tuple[int, int], float] | None = None) -> tuple[Array, Array]:
    """Return the most probable trajectory and its variance, both [shape=(T, P)].

    mean, precision : [shape=(T, 3, P)], of the static value, Δ = (-½, 0, ½) and Δ² = (1, -2, 1)
    pins : value by (frame, channel), which the trajectory takes exactly and with variance 0
    Source: Hofer 2008, Eqs. 6–11.  Cost: O(T·P).
    """
    fast = compiled_pays(len(mean) * FRAME_S)
    if fast and not pins:
        from lipmotion.kernels.compiled import banded

        return banded.generate(np.ascontiguousarray(mean, float), np.ascontiguousarray(precision, float))
    bands = normal_equations(mean, precision)
    for (frame, channel), value in (pins or {}).items():
        pin(bands, frame, channel, value)
    values, variance = _solved(bands, fast)
    for frame, channel in pins or ():
        variance[frame, channel] = 0
    return values, variance


def normal_equations(mean: Array, precision: Array) -> Bands:
    """Return the system W'PW x = W'P m of maximum-likelihood parameter generation.

    mean, precision : [shape=(T, 3, P)], of the static value, Δ = (-½, 0, ½) and Δ² = (1, -2, 1)
    Δ and Δ² of the first and last frame, which need frames outside, have precision 0.
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
    """Change the system, in place, so that its solution is ``value`` in one frame of one channel; once for each."""
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
    return _solved(bands, compiled_pays(len(bands[0]) * FRAME_S))


def _solved(bands: Bands, fast: bool) -> tuple[Array, Array]:
    if fast:
        from lipmotion.kernels.compiled import banded

        return banded.solve(*bands)
    shape = bands[0].shape
    rows = (diagonal[:, 0].tolist() if shape[1] == 1 else list(diagonal) for diagonal in bands)
    values, variance = _substituted(*_eliminated(*rows))
    return values.reshape(shape), variance.reshape(shape)


def _eliminated(main: Rows, first: Rows, second: Rows, right: Rows) -> tuple[Rows, Rows, Rows, Rows]:
    """Return 1 / D and both diagonals of L of the factorisation LDLᵀ, and L⁻¹ times the right-hand side.

    Rows are arrays of all channels, or the numbers of a single one: these cost a twentieth.
    """
    inverse, lower1, lower2, x = Rows(), Rows(), Rows(), Rows()
    near = far = next_far = l1 = l2 = earlier_l2 = x1 = x2 = 0.0
    for diagonal, below, two_below, wanted in zip(main, first, second, right, strict=True):
        inverse.append(1 / (diagonal - near * l1 - far * earlier_l2))
        near = below - near * l2
        x.append(wanted - l1 * x1 - earlier_l2 * x2)
        x1, x2 = x[-1], x1
        l1, l2, earlier_l2 = near * inverse[-1], two_below * inverse[-1], l2
        far, next_far = next_far, two_below
        lower1.append(l1)
        lower2.append(l2)
    return inverse, lower1, lower2, x


def _substituted(inverse: Rows, lower1: Rows, lower2: Rows, x: Rows) -> tuple[Array, Array]:
    """Return the solution and the diagonal of the inverse from the factors."""
    values, variances = Rows(), Rows()
    value = next_value = variance = next_variance = 0.0
    beside = 0.0  # of the inverse, between the next row and the one after it
    for one, l1, l2, wanted in zip(*map(reversed, (inverse, lower1, lower2, x)), strict=True):
        value, next_value = wanted * one - l1 * value - l2 * next_value, value
        across = -(l1 * variance) - l2 * beside
        far = -(l1 * beside) - l2 * next_variance
        variance, next_variance = one - l1 * across - l2 * far, variance
        beside = across
        values.append(value)
        variances.append(variance)
    return np.array(values[::-1]), np.array(variances[::-1])
