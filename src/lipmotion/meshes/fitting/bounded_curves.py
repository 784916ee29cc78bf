"""Bounded least squares over time: curves between 0 and 1 that follow targets and are smooth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError

Array = NDArray[np.float64]

LARGEST_EIGENVALUE = 16.0
"""The largest eigenvalue of the squared second difference."""
MOST_STEPS = 2000
TOLERANCE = 1e-5
"""Iteration stops when no weight changes by more than this in a step."""


@dataclass(frozen=True)
class CurveCosts:
    """What curves cost beside their distance from the targets.

    ridge  : of the squared weights themselves, against shapes that move much to change little
    smooth : of their squared second differences in time
    """

    ridge: float = 1e-3
    smooth: float = 1e-1


def fit_bounded_curves(
    matrix: Array, targets: Array, costs: CurveCosts | None = None, ties: Array | None = None
) -> Array:
    """Return weights w between 0 and 1 that minimise the distance of ``w @ matrix`` from targets [shape=(T, S)].

    matrix  : what each of S shapes adds at weight 1 [shape=(S, D)]
    targets : one row a frame [shape=(T, D)]
    ties    : further rows that should be 0, as left weight − right weight [shape=(R, S)]
    Minimises Σ_t ‖w_t M − d_t‖² + ridge ‖w_t‖² + ‖ties w_t‖² + smooth ‖w_{t−1} − 2 w_t + w_{t+1}‖², 0 ≤ w ≤ 1.
    Raises InputError: shapes of arrays that do not fit, or values that are not finite.
    Source: Beck & Teboulle 2009 (FISTA), with the restart of O'Donoghue & Candès 2015 and a diagonal preconditioner.
    Cost: O(T·S²) a step; some hundred steps.
    """
    costs = costs or CurveCosts()
    if matrix.ndim != 2 or targets.ndim != 2 or matrix.shape[1] != targets.shape[1]:
        raise InputError(f"shapes {matrix.shape} and targets {targets.shape} do not fit, required (S, D) and (T, D)")
    if not (np.isfinite(matrix).all() and np.isfinite(targets).all()):
        raise InputError("shapes or targets have values that are not finite")
    square = matrix @ matrix.T + costs.ridge * np.eye(len(matrix))
    if ties is not None:
        square = square + ties.T @ ties
    scale = np.sqrt(np.diag(square))
    wanted = targets @ matrix.T / scale
    square = square / np.outer(scale, scale)
    smooth = costs.smooth / scale**2
    step = 1 / (np.linalg.eigvalsh(square)[-1] + LARGEST_EIGENVALUE * float(smooth.max(initial=0.0)))
    kept, pull, stiff = np.eye(len(square)) - step * square, step * wanted, step * smooth
    current = ahead = np.clip(wanted, 0, scale)
    momentum, seconds = 1.0, np.zeros((len(targets) + 2, len(matrix)))
    for _ in range(MOST_STEPS):
        following = ahead @ kept  # a step along the gradient, in place: most time goes into the calls of NumPy
        following += pull
        following -= _fourth_difference(ahead, stiff, seconds)
        np.clip(following, 0, scale, out=following)
        change = following - current
        if np.vdot(ahead - following, change) > 0:
            momentum, ahead = 1.0, following
        else:
            faster = (1 + np.sqrt(1 + 4 * momentum * momentum)) / 2
            ahead = following + (momentum - 1) / faster * change
            momentum = faster
        current = following
        if np.abs(change / scale).max(initial=0.0) < TOLERANCE * step:
            break
    return np.clip(current / scale, 0, 1)


def _fourth_difference(curves: Array, stiff: Array, seconds: Array) -> Array:
    """Return the gradient of half the squared second differences of curves, times the stiffness [shape=(T, S)].

    stiff   : of each curve [shape=(S,)]
    seconds : for the second differences, the first two and the last two of which are 0 [shape=(T + 2, S)]
    """
    if len(curves) > 2:
        inner = seconds[2:-2]
        np.subtract(curves[:-2], curves[1:-1], out=inner)
        inner -= curves[1:-1]
        inner += curves[2:]
    result = seconds[2:] - seconds[1:-1]
    result -= seconds[1:-1]
    result += seconds[:-2]
    result *= stiff
    return result
