"""Maximum-likelihood parameter generation: the trajectory of Gaussians of static values, Δ and Δ²."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.choice import compiled_pays

Array = NDArray[np.float64]
Bands = tuple[Array, Array, Array, Array]
"""Main, first and second diagonal of the symmetric system of each channel, and its right-hand side [shapes=(T, P)]."""
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
    return _substitute(*_eliminate(*bands))


def _eliminate(main: Array, first: Array, second: Array, right: Array) -> tuple[Array, Array, Array, Array]:
    """Return 1 / D and both diagonals of L of the factorisation LDLᵀ, and L⁻¹ times the right-hand side."""
    frames, channels = main.shape
    inverse = np.empty_like(main)
    lower1, lower2, x, coupling, far = (np.zeros((frames + 2, channels)) for _ in range(5))  # row t lies at t + 2
    far[2:] = second
    for t in range(frames):
        pivot = main[t] - coupling[t + 1] * lower1[t + 1] - far[t] * lower2[t]
        coupling[t + 2] = first[t] - coupling[t + 1] * lower2[t + 1]
        x[t + 2] = right[t] - lower1[t + 1] * x[t + 1] - lower2[t] * x[t]
        np.divide(1, pivot, out=inverse[t])
        np.multiply(coupling[t + 2], inverse[t], out=lower1[t + 2])
        np.multiply(second[t], inverse[t], out=lower2[t + 2])
    return inverse, lower1[2:], lower2[2:], x[2:]


def _substitute(inverse: Array, lower1: Array, lower2: Array, x: Array) -> tuple[Array, Array]:
    """Return the solution and the diagonal of the inverse from the factors."""
    frames, channels = inverse.shape
    values, variance = np.zeros((frames + 2, channels)), np.zeros((frames + 2, channels))
    np.multiply(x, inverse, out=values[:frames])
    beside = np.zeros(channels)  # of the inverse, between the next row and the one after it
    for t in range(frames - 1, -1, -1):
        l1, l2 = lower1[t], lower2[t]
        values[t] = values[t] - l1 * values[t + 1] - l2 * values[t + 2]
        across = -(l1 * variance[t + 1]) - l2 * beside
        far = -(l1 * beside) - l2 * variance[t + 2]
        variance[t] = inverse[t] - l1 * across - l2 * far
        beside = across
    return values[:frames], variance[:frames]
