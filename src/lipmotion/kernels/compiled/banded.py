"""Parameter generation, compiled: vectorised over channels, without storing the system.

The operations and their order are those of ``sequences.banded``, and so the results are the same to the bit. Functions
take their arrays as separate arguments, more than eight in places: numba compiles that to the fastest code.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiled.compiler import compiled

Array = NDArray[np.float64]


@compiled
def generate(mean: Array, precision: Array) -> tuple[Array, Array]:
    """Return trajectory and variance [shape=(T, P)]; see ``kernels.sequences.banded.generate``."""
    T, _, P = mean.shape
    values, variance, lower1, lower2, previous = _room(T, P)
    bands = np.empty((4, 1, P))
    main, first, second, right = bands
    for t in range(T):
        _assemble(mean, precision, t, bands)
        _eliminate(main, first, second, right, 0, t, values, variance, lower1, lower2, previous)
    _substitute(values, variance, lower1, lower2, previous)
    return values[2 : T + 2], variance[2 : T + 2]


@compiled
def solve(main: Array, first: Array, second: Array, right: Array) -> tuple[Array, Array]:
    """Return solution and diagonal of the inverse [shape=(T, P)]; see ``kernels.sequences.banded.solve``."""
    T, P = main.shape
    values, variance, lower1, lower2, previous = _room(T, P)
    for t in range(T):
        _eliminate(main, first, second, right, t, t, values, variance, lower1, lower2, previous)
    _substitute(values, variance, lower1, lower2, previous)
    return values[2 : T + 2], variance[2 : T + 2]


@compiled
def _room(T: int, P: int) -> tuple[Array, Array, Array, Array, Array]:
    """Return empty arrays for the solution, the variance and both diagonals of L [shapes=(T + 4, P)], with row t at
    t + 2 between rows of zeros, and zeros for values of the rows before [shape=(3, P)].

    Until ``_substitute``, the solution holds L⁻¹ times the right-hand side, and the variance 1 / D.
    """
    values, variance, lower1, lower2 = (
        np.empty((T + 4, P)),
        np.empty((T + 4, P)),
        np.empty((T + 4, P)),
        np.empty((T + 4, P)),
    )
    for row in (0, 1, T + 2, T + 3):
        values[row], variance[row], lower1[row], lower2[row] = 0, 0, 0, 0
    return values, variance, lower1, lower2, np.zeros((3, P))


@compiled
def _assemble(mean: Array, precision: Array, t: int, bands: Array) -> None:
    """Fill in one row of the normal equations; Δ and Δ² of the first and last frame have no weight."""
    T = len(mean)
    before, after = max(t - 1, 0), min(t + 1, T - 1)
    inner = 1.0 if 0 < t < T - 1 else 0.0
    has_before = 1.0 if t > 1 else 0.0
    has_after = 1.0 if t + 2 < T else 0.0
    for c in range(mean.shape[2]):
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


@compiled
def _eliminate(
    main: Array, first: Array, second: Array, right: Array, row: int,
    t: int, x: Array, inverse: Array, lower1: Array, lower2: Array, previous: Array,
) -> None:  # fmt: skip
    """Factorise one row, and eliminate it from its right-hand side.

    previous : of the row before its coupling and second diagonal, and the second diagonal of the row before that
    """
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
