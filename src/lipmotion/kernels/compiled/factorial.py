"""Steps of factorial hidden Markov models, compiled: few passes over the joint states.

Densities are multiplied in double precision, and products under a least value are set to 0: none is denormal, which
would be many times slower. Probabilities of a frame sum to ``whole``, and are raised to 1 / ``whole`` where they are
less (``kernels.sequences.factorial``): so products of two of them are no denormal either.
Arrays with suffix ``_0`` or ``_1`` belong to that axis; U is the number of units of an axis. Functions take their
arrays as separate arguments, more than eight in places: numba compiles that to the fastest code.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiled.compiler import compiled, compiled_to_rounding

Array = NDArray[Any]
Index = NDArray[np.intp]


@compiled_to_rounding
def moved_to_last(before: Array, stay: Array, onward: Array, entering: Array, count: int) -> Array:
    """Return the last ``count`` columns of joint probabilities, moved one frame on along axis 0.

    entering : [shape=(U, M)], probabilities of entering the first states
    """
    last, into_last = before[:, before.shape[1] - count :], entering[:, before.shape[1] - count :]
    after = np.empty((len(before), count), before.dtype)
    for i in range(len(before)):
        _move(last, stay, onward, into_last, i, after[i])
    return after


@compiled_to_rounding
def moved_back(after: Array, stay: Array, onward: Array, left: Array) -> Array:
    """Return joint backward probabilities, moved one frame back along axis 1.

    left : [shape=(N, U)], those of leaving the last states
    """
    before, units = np.empty_like(after), left.shape[1]
    inner = after.shape[1] - units
    for i in range(len(after)):
        into, out = before[i], after[i]
        next_states = out[units:]
        for j in range(inner):
            into[j] = stay[j] * out[j] + onward[j] * next_states[j]
        last, out_last, stay_last, left_last = into[inner:], out[inner:], stay[inner:], left[i]
        for j in range(units):
            last[j] = stay_last[j] * out_last[j] + left_last[j]
    return before


@compiled_to_rounding
def forward(
    before: Array, stay_0: Array, onward_0: Array, entering_0: Array, stay_1: Array, onward_1: Array, entering_1: Array,
    density_0: Array, density_1: Array, pair_0: Index, pair_1: Index, pair: Array, least: float, whole: float,
    after: Array,
) -> float:  # fmt: skip
    """Fill in joint probabilities one frame on along both axes, times densities, normalised; return their sum before
    as a share of the whole.

    entering_0, entering_1 : [shapes=(U, M), (N, U)], probabilities of entering the first states
    pair_0 ... pair : the two states of each pair, sorted by the first, and the densities of pairs
    least : smaller products are set to 0
    """
    moved, prior = np.empty(before.shape[1], before.dtype), np.empty(before.shape[1], before.dtype)
    total, p = 0.0, 0
    for i in range(len(before)):
        _move(before, stay_0, onward_0, entering_0, i, moved)
        _move_along(moved, stay_1, onward_1, entering_1[i], prior)
        _emit(prior, density_0[i], density_1, least, after[i])
        p = _emit_pairs(prior, i, p, pair_0, pair_1, pair, least, after[i])
        total += _sum(after[i])
    _share(after, total, whole)
    return total / whole


@compiled_to_rounding
def backward(
    before: Array, moved: Array, stay: Array, onward: Array, left: Array,
    density_0: Array, density_1: Array, pair_0: Index, pair_1: Index, pair: Array, least: float, whole: float,
    after: Array, posterior_0: Array, posterior_1: Array, posterior_pair: Array,
) -> float:  # fmt: skip
    """Fill in backward probabilities times densities, normalised, and posteriors, not normalised; return the sum of the
    former before, as a share of the whole.

    before : forward probabilities
    moved  : backward probabilities that were moved back along axis 1; they are moved along axis 0 here
    left   : [shape=(U, M)], those of leaving the last states
    """
    beta = np.empty(before.shape[1], before.dtype)
    units, total, p = len(left), 0.0, 0
    inner = len(before) - units
    posterior_1[:] = 0
    for i in range(len(before)):
        if i < inner:
            _combine(moved[i], stay[i], moved[i + units], onward[i], beta)
        else:
            _combine(moved[i], stay[i], left[i - inner], 1.0, beta)
        posterior_0[i] = _meet(before[i], beta, posterior_1)
        q = p
        while q < len(pair_0) and pair_0[q] == i:
            posterior_pair[q] = np.float64(before[i, pair_1[q]]) * beta[pair_1[q]]
            q += 1
        _emit(beta, density_0[i], density_1, least, after[i])
        p = _emit_pairs(beta, i, p, pair_0, pair_1, pair, least, after[i])
        total += _sum(after[i])
    _share(after, total, whole)
    return total / whole


@compiled
def take_best_entering(last: Array, leaving: Array, score: Array, decision: Array) -> None:
    """Replace the log scores of first states by those of the best transition from a last state, where that is greater,
    and their decisions by the unit that is left.

    last     : log scores of the last states [shape=(U, M)]
    leaving  : log probabilities of the transitions from them to the first states [shape=(U, U)]
    score, decision : of the first states [shapes=(U, M)]
    """
    for i in range(len(score)):
        best, unit = score[i], decision[i]
        for u in range(len(last)):
            before, weight = last[u], leaving[u, i]
            for j in range(len(best)):
                other = before[j] + weight
                is_better = other > best[j]
                best[j] = other if is_better else best[j]
                unit[j] = u if is_better else unit[j]


@compiled_to_rounding
def _combine(one: Array, weight: float, other: Array, other_weight: float, into: Array) -> None:
    """Fill in the weighted sum of two rows."""
    first, second = into.dtype.type(weight), into.dtype.type(other_weight)
    for j in range(len(into)):
        into[j] = first * one[j] + second * other[j]


@compiled_to_rounding
def _move(before: Array, stay: Array, onward: Array, entering: Array, i: int, into: Array) -> None:
    """Fill in row i, one frame on along axis 0."""
    units = len(entering)
    if i < units:
        _combine(before[i], stay[i], entering[i], 1.0, into)
    else:
        _combine(before[i], stay[i], before[i - units], onward[i - units], into)


@compiled_to_rounding
def _move_along(before: Array, stay: Array, onward: Array, entering: Array, into: Array) -> None:
    """Fill in a row, one frame on along itself."""
    units = len(entering)
    for j in range(units):
        into[j] = stay[j] * before[j] + entering[j]
    rest, before_rest, weight = into[units:], before[units:], stay[units:]
    for j in range(len(onward)):
        rest[j] = weight[j] * before_rest[j] + onward[j] * before[j]


@compiled_to_rounding
def _emit(prior: Array, own: float, density: Array, least: float, into: Array) -> None:
    """Fill in a row times the densities of both axes; ``own`` is that of the row."""
    for j in range(len(prior)):
        partly = np.float64(prior[j]) * own
        product = (partly if partly > least else 0.0) * density[j]
        into[j] = product if product > least else 0.0


@compiled_to_rounding
def _emit_pairs(
    prior: Array, i: int, p: int, pair_0: Index, pair_1: Index, pair: Array, least: float, into: Array
) -> int:
    """Multiply the pairs of row i, from pair p on, by their own densities; return the first pair of the next row."""
    while p < len(pair_0) and pair_0[p] == i:
        product = np.float64(prior[pair_1[p]]) * pair[p]
        into[pair_1[p]] = product if product > least else 0.0
        p += 1
    return p


@compiled_to_rounding
def _sum(row: Array) -> float:
    total = 0.0
    for j in range(len(row)):
        total += row[j]
    return total


@compiled_to_rounding
def _meet(one: Array, other: Array, sums: Array) -> float:
    """Add the products of two rows to ``sums``, and return their sum."""
    total = 0.0
    for j in range(len(one)):
        product = np.float64(one[j]) * other[j]
        sums[j] += product
        total += product
    return total


@compiled_to_rounding
def _share(joint: Array, total: float, whole: float) -> None:
    """Make joint probabilities sum to ``whole``; raise the least of them to 1 / ``whole``."""
    flat = joint.reshape(joint.size)
    scale, least = whole / total if total > 0 else 0.0, 1 / whole
    for j in range(len(flat)):
        share = flat[j] * scale
        flat[j] = share if share > least else least
