"""Parameter generation, compiled: across channels with the processor's vectors, the system never stored.

The same operations in the same order as in ``kernels.banded``, and so the same bits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiled.compiler import compiled

Array = NDArray[np.float64]


@compiled
def generate(mean: Array, precision: Array) -> tuple[Array, Array]:
    """Return trajectory and variance [shape=(T, P)]; see ``kernels.banded.generate``."""
    T, _, P = mean.shape
    row, blank = np.empty((4, P)), np.zeros((3, P))
    inverse, lower1, lower2, x, held = _storage(T, P)
    for t in range(T):
        inside, after = 0 < t < T - 1, t + 2 < T
        here = precision[t] if inside else blank
        before = precision[t - 1] if t > 1 else blank
        behind = precision[t + 1] if after else blank
        _assemble(
            precision[t, 0], here[2], before[1], before[2], behind[1], behind[2],
            mean[t, 0], mean[t, 2], mean[max(t - 1, 0)], mean[min(t + 1, T - 1)],
            row[0], row[1], row[2], row[3],
        )  # fmt: skip
        _eliminate(row[0], row[1], row[2], row[3], t, inverse, lower1, lower2, x, held[0], held[1], held[2])
    return _substitute(inverse, lower1, lower2, x)


@compiled
def solve(main: Array, first: Array, second: Array, right: Array) -> tuple[Array, Array]:
    """Return solution and diagonal of the inverse [shape=(T, P)]; see ``kernels.banded.solve``."""
    T, P = main.shape
    inverse, lower1, lower2, x, held = _storage(T, P)
    for t in range(T):
        _eliminate(main[t], first[t], second[t], right[t], t, inverse, lower1, lower2, x, held[0], held[1], held[2])
    return _substitute(inverse, lower1, lower2, x)


@compiled
def _storage(T: int, P: int) -> tuple[Array, Array, Array, Array, Array]:
    """Return room for the factors, whose row t lies behind two rows of zeros, and for what is held between rows."""
    lower1, lower2, x = np.empty((T + 2, P)), np.empty((T + 2, P)), np.empty((T + 2, P))
    lower1[:2], lower2[:2], x[:2] = 0, 0, 0
    return np.empty((T, P)), lower1, lower2, x, np.zeros((3, P))


@compiled
def _assemble(
    p0: Array, p2: Array, p1_before: Array, p2_before: Array, p1_behind: Array, p2_behind: Array,
    m0: Array, m2: Array, before: Array, behind: Array, main: Array, first: Array, second: Array, right: Array,
) -> None:  # fmt: skip
    """Fill in one row of the normal equations."""
    for c in range(main.shape[0]):
        w2_before, w2_behind = p2_before[c] * before[2, c], p2_behind[c] * behind[2, c]
        w1_before, w1_behind = p1_before[c] * before[1, c], p1_behind[c] * behind[1, c]
        main[c] = p0[c] + 4 * p2[c] + (0.25 * p1_before[c] + p2_before[c]) + (0.25 * p1_behind[c] + p2_behind[c])
        first[c] = -2 * (p2[c] + p2_behind[c])
        second[c] = p2_behind[c] - 0.25 * p1_behind[c]
        plain = p0[c] * m0[c] - 2 * (p2[c] * m2[c])
        right[c] = plain + (0.5 * w1_before + w2_before) + (-0.5 * w1_behind + w2_behind)


@compiled
def _eliminate(
    main: Array, first: Array, second: Array, right: Array, t: int,
    inverse: Array, lower1: Array, lower2: Array, x: Array, beside: Array, far: Array, farther: Array,
) -> None:  # fmt: skip
    """Factorise one row and take it out of its right-hand side."""
    for c in range(main.shape[0]):
        pivot = main[c] - beside[c] * lower1[t + 1, c] - farther[c] * lower2[t, c]
        coupling = first[c] - beside[c] * lower2[t + 1, c]
        x[t + 2, c] = right[c] - lower1[t + 1, c] * x[t + 1, c] - lower2[t, c] * x[t, c]
        reciprocal = 1 / pivot
        inverse[t, c] = reciprocal
        lower1[t + 2, c] = coupling * reciprocal
        lower2[t + 2, c] = second[c] * reciprocal
        beside[c], farther[c], far[c] = coupling, far[c], second[c]


@compiled
def _substitute(inverse: Array, lower1: Array, lower2: Array, x: Array) -> tuple[Array, Array]:
    """Return solution and diagonal of the inverse from the factors."""
    T, P = inverse.shape
    values, variance = np.empty((T + 2, P)), np.empty((T + 2, P))
    values[T:], variance[T:] = 0, 0
    beside = np.zeros(P)  # of the inverse, between the next row and the one behind it
    for t in range(T - 1, -1, -1):
        for c in range(P):
            l1, l2 = lower1[t + 2, c], lower2[t + 2, c]
            values[t, c] = x[t + 2, c] * inverse[t, c] - l1 * values[t + 1, c] - l2 * values[t + 2, c]
            across = -(l1 * variance[t + 1, c]) - l2 * beside[c]
            far = -(l1 * beside[c]) - l2 * variance[t + 2, c]
            variance[t, c] = inverse[t, c] - l1 * across - l2 * far
            beside[c] = across
    return values[:T], variance[:T]
