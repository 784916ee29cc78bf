"""Parameter generation, in NumPy for a short recording, which must not wait for numba, and compiled: the same bits.

The trajectory of greatest likelihood of Gaussians of static values, Δ and Δ².
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiler import compiled, pays

Array = NDArray[np.float64]
Bands = tuple[Array, Array, Array, Array]
"""Main, first and second diagonal of the symmetric system of each channel, and its right-hand side [shapes=(T, P)]."""
Rows = list[Any]  # a row of each frame: an array of the channels [shape=(P,)], or a number


def solve_mlpg(
    mean: Array, precision: Array, pins: Mapping[tuple[int, int], float] | None = None
) -> tuple[Array, Array]:
    """Return the most probable trajectory and its variance, both [shape=(T, P)].

    mean, precision : [shape=(T, 3, P)], of the static value, Δ = (-½, 0, ½) and Δ² = (1, -2, 1)
    pins : value by (frame, channel), which the trajectory takes exactly and with variance 0
    Source: Hofer 2008, Eqs. 6–11.  Cost: O(T·P).
    """
    if not pins and pays(len(mean)):
        return _generate(np.ascontiguousarray(mean, float), np.ascontiguousarray(precision, float))
    bands = build_equations(mean, precision)
    for (frame, channel), value in (pins or {}).items():
        pin(bands, frame, channel, value)
    values, variance = solve(bands)
    for frame, channel in pins or ():
        variance[frame, channel] = 0
    return values, variance


def build_equations(mean: Array, precision: Array) -> Bands:
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
    if pays(len(bands[0])):
        return _solve(*bands)
    shape = bands[0].shape
    # the numbers of a single channel cost a twentieth of arrays
    rows = (diagonal[:, 0].tolist() if shape[1] == 1 else list(diagonal) for diagonal in bands)
    values, variance = _back_substitute(*_eliminate_rows(*rows))
    return values.reshape(shape), variance.reshape(shape)


def _eliminate_rows(main: Rows, first: Rows, second: Rows, right: Rows) -> tuple[Rows, Rows, Rows, Rows]:
    """Return 1 / D and both diagonals of L of the factorisation LDLᵀ, and L⁻¹ times the right-hand side."""
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


def _back_substitute(inverse: Rows, lower1: Rows, lower2: Rows, x: Rows) -> tuple[Array, Array]:
    values, variances = Rows(), Rows()
    value = next_value = variance = next_variance = 0.0
    off_diagonal = 0.0  # of the inverse, between the next row and the one after it
    for one, l1, l2, wanted in zip(*map(reversed, (inverse, lower1, lower2, x)), strict=True):
        value, next_value = wanted * one - l1 * value - l2 * next_value, value
        across = -(l1 * variance) - l2 * off_diagonal
        far = -(l1 * off_diagonal) - l2 * next_variance
        variance, next_variance = one - l1 * across - l2 * far, variance
        off_diagonal = across
        values.append(value)
        variances.append(variance)
    return np.array(values[::-1]), np.array(variances[::-1])


@compiled
def _generate(mean: Array, precision: Array) -> tuple[Array, Array]:
    """Do what ``solve_mlpg`` does, all channels in one loop, without storing the system."""
    T, _, P = mean.shape
    values, variance, lower1, lower2, previous = _room(T, P)
    bands = np.empty((4, 1, P))
    main, first, second, right = bands
    for t in range(T):
        before, after = max(t - 1, 0), min(t + 1, T - 1)
        inner = 1.0 if 0 < t < T - 1 else 0.0  # Δ and Δ² of the first and last frame have no weight
        has_before = 1.0 if t > 1 else 0.0
        has_after = 1.0 if t + 2 < T else 0.0
        for c in range(P):
            p0, p2 = precision[t, 0, c], precision[t, 2, c] * inner
            p1_before, p2_before = precision[before, 1, c] * has_before, precision[before, 2, c] * has_before
            p1_after, p2_after = precision[after, 1, c] * has_after, precision[after, 2, c] * has_after
            w1_before, w2_before = p1_before * mean[before, 1, c], p2_before * mean[before, 2, c]
            w1_after, w2_after = p1_after * mean[after, 1, c], p2_after * mean[after, 2, c]
            bands[0, 0, c] = p0 + 4 * p2 + (0.25 * p1_before + p2_before) + (0.25 * p1_after + p2_after)
            bands[1, 0, c] = -2 * (p2 + p2_after)
            bands[2, 0, c] = p2_after - 0.25 * p1_after
            plain = p0 * mean[t, 0, c] - 2 * (p2 * mean[t, 2, c])
            bands[3, 0, c] = plain + (0.5 * w1_before + w2_before) + (-0.5 * w1_after + w2_after)
        _eliminate(main, first, second, right, 0, t, values, variance, lower1, lower2, previous)
    _substitute(values, variance, lower1, lower2, previous)
    return values[2 : T + 2], variance[2 : T + 2]


@compiled
def _solve(main: Array, first: Array, second: Array, right: Array) -> tuple[Array, Array]:
    T, P = main.shape
    values, variance, lower1, lower2, previous = _room(T, P)
    for t in range(T):
        _eliminate(main, first, second, right, t, t, values, variance, lower1, lower2, previous)
    _substitute(values, variance, lower1, lower2, previous)
    return values[2 : T + 2], variance[2 : T + 2]


@compiled
def _room(T: int, P: int) -> tuple[Array, Array, Array, Array, Array]:
    """Return arrays for the solution (until ``_substitute``: L⁻¹ times the right-hand side), the variance (until then:
    1 / D) and both diagonals of L, with row t at t + 2 between rows of zeros, and zeros for values of the rows before.
    """
    values, variance = np.empty((T + 4, P)), np.empty((T + 4, P))
    lower1, lower2 = np.empty((T + 4, P)), np.empty((T + 4, P))
    for row in (0, 1, T + 2, T + 3):
        values[row], variance[row], lower1[row], lower2[row] = 0, 0, 0, 0
    return values, variance, lower1, lower2, np.zeros((3, P))


@compiled
def _eliminate(
    main: Array, first: Array, second: Array, right: Array, row: int,
    t: int, x: Array, inverse: Array, lower1: Array, lower2: Array, previous: Array,
) -> None:  # fmt: skip
    """Factorise a row, and eliminate it from its right-hand side; ``previous``: coupling, second diagonals before."""
    for c in range(x.shape[1]):
        pivot = main[row, c] - previous[0, c] * lower1[t + 1, c] - previous[2, c] * lower2[t, c]
        coupling = first[row, c] - previous[0, c] * lower2[t + 1, c]
        x[t + 2, c] = right[row, c] - lower1[t + 1, c] * x[t + 1, c] - lower2[t, c] * x[t, c]
        reciprocal = 1 / pivot
        inverse[t + 2, c] = reciprocal
        lower1[t + 2, c] = coupling * reciprocal
        lower2[t + 2, c] = second[row, c] * reciprocal
        previous[0, c], previous[2, c], previous[1, c] = coupling, previous[1, c], second[row, c]


@compiled
def _substitute(x: Array, variance: Array, lower1: Array, lower2: Array, previous: Array) -> None:
    """Substitute backwards: replace the arrays of ``_room`` by the solution and the diagonal of the inverse."""
    previous[0] = 0  # of the inverse, between the next row and the one after it
    for t in range(len(x) - 3, 1, -1):
        for c in range(x.shape[1]):
            l1, l2 = lower1[t, c], lower2[t, c]
            x[t, c] = x[t, c] * variance[t, c] - l1 * x[t + 1, c] - l2 * x[t + 2, c]
            across = -(l1 * variance[t + 1, c]) - l2 * previous[0, c]
            far = -(l1 * previous[0, c]) - l2 * variance[t + 2, c]
            variance[t, c] = variance[t, c] - l1 * across - l2 * far
            previous[0, c] = across
