"""Forward–backward through networks, compiled, with scaled probabilities.

All is in one precision, single or double, but for products and sums that are followed by a division. Probabilities
under a least one are raised to it, never set to 0: so no product is denormal, which would be many times slower, and
forward probabilities are upper bounds.

Let N be the sum over the states of a frame of forward times backward probabilities, divided by the likelihood that was
computed: in the last frame it is 1. From each frame to the one before, and from the first frame to the beginning (whose
forward probabilities are the initial ones), N changes by

    + what was raised backward, times the forward probabilities: negligible, as these sum to ``MOST_SCALE`` at most
    − what was raised forward, times the backward probabilities
    − what was lost backward (where blocks are multiplied, or an arc underflows), times the forward probabilities

So if no N is under 1 − δ, the last two sum to δ at most, over all frames. They bound what is wrong: the likelihood is
too great by a share of δ at most, and the errors of the posteriors of a frame sum to 3 δ at most, but for rounding. A
recording with a smaller N is left to the caller.

Functions take their arrays as separate arguments, more than eight in places: numba compiles that to the fastest code.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiled.compiler import compiled_to_rounding

Array = NDArray[Any]
"""float32 or float64."""
Index = NDArray[np.intp]
Unsigned = NDArray[np.uintp]
"""Unsigned, as loops over indices that may be negative are not vectorised."""
CHUNK = 16
"""Runs are padded to multiples of this, so that vectorised loops over them have no remainder."""
LEAST_POSTERIOR = 1e-12
"""Smaller posteriors are set to 0."""
SHARE = 1e-6
"""Shares of a block's sources are set to 0 under this times the least probability: less than what is raised."""
LEAST_ROOT = 1.9e-35
"""exp(-80): densities up to its eighth power are set to 0."""
MOST_SCALE = 1e6
"""Greatest scale of a frame. With a smaller one no share of forward probabilities is set to 0."""
FRAMES_SUMMED = 256
"""Frames that are summed in the kernel's precision, before they are added in double precision."""


@compiled_to_rounding
def products(roots: Array, columns: NDArray[np.uint32], joint: Array, best: Array) -> None:
    """Fill in the roots of joint densities relative to the best of each frame, and the root of the best.

    roots   : float32 or float64 [shape=(T, G)], of all chains side by side, each relative to the chain's best
    columns : [shape=(C, S)], for each chain, the column of the state at each place
    joint   : [shape=(T, S)], of the precision of ``roots``
    best    : [shape=(T,)]; 0 where all are 0
    """
    states = columns.shape[1]
    factor, product, tops = np.empty(roots.shape[1], roots.dtype), np.empty(states), np.empty(8)
    for t in range(len(roots)):
        for g in range(len(factor)):
            factor[g] = roots[t, g] if roots[t, g] > LEAST_ROOT else 0.0
        for s in range(states):
            product[s] = factor[columns[0, s]]
        for c in range(1, len(columns)):
            column = columns[c]
            for s in range(states):
                product[s] *= factor[column[s]]
        tops[:] = 0.0
        for s in range(0, states - 7, 8):
            for k in range(8):
                tops[k] = max(tops[k], product[s + k])
        for s in range(states // 8 * 8, states):
            tops[0] = max(tops[0], product[s])
        best[t] = tops.max()
        scale = 1 / best[t] if best[t] > 0 else 0.0
        row = joint[t]
        for s in range(states):
            root = product[s] * scale
            row[s] = root if root > LEAST_ROOT else 0.0


@compiled_to_rounding
def forward_backward(
    emission: Array, edges: Index, initial: Array, final: Array, runs: Unsigned, run_weight: Array,
    blocks: Unsigned, block_sources: Unsigned, block_weight: Array, transposed: Array,
    least: float, least_scale: float, off: float,
) -> tuple[Array, Array, Array, Array, Array]:  # fmt: skip
    """Return the expected counts of recordings in a network; ``emission`` is overwritten by the posteriors.

    emission     : [shape=(T, S)], by place, all recordings concatenated: the eighth roots of densities relative to the
                   best of each frame; its precision, which the weights have too, is that of the computation
    edges        : [shape=(U + 1,)], the first frame of each recording, and T
    initial, final : [shape=(S,)], in double precision, the greatest 1
    runs, run_weight : of the layout and its weights (``sequences.arcs``), padded with arcs of weight 0; weights up to 1
    blocks ... block_weight : of the layout and its weights
    transposed   : the weights of blocks, targets as rows
    least, least_scale, off : least probability, least scale of a frame, and largest error of N (see above)
    Returns the expected count of each run arc divided by its weight [shape=(N,)]; the forward probabilities of all
    blocks' sources and the backward ones of their targets in the next frame, whose products summed over time give the
    counts of block arcs [shapes=(T, ...)]; the scale of each frame [shape=(T,)] and of each end [shape=(U,)]: the
    product of all scales is the likelihood. For a recording that was left the scale of the end is 0, and ``emission``
    has no meaning.
    """
    T, S = emission.shape
    targets, longest = 0, 0
    for b in range(len(blocks)):
        targets += blocks[b, 1]
    counts, scales, ends = np.zeros(len(run_weight)), np.ones(T), np.zeros(len(edges) - 1)
    leaving, entering = np.zeros((T, len(block_sources))), np.zeros((T, targets))
    for u in range(len(ends)):
        longest = max(longest, edges[u + 1] - edges[u])
    forward, few = np.empty((longest, S + CHUNK), emission.dtype), np.empty(len(counts), emission.dtype)
    beta, onward = np.zeros(S + CHUNK, emission.dtype), np.zeros(S + CHUNK, emission.dtype)
    of_recording = np.zeros(len(counts))
    room = np.empty(max(block_weight.shape[1], transposed.shape[1]), emission.dtype)
    share = np.empty(max(len(block_weight), len(transposed)), emission.dtype)
    for u in range(len(ends)):
        frames = slice(edges[u], edges[u + 1])
        density, scale, leave, enter = emission[frames], scales[frames], leaving[frames], entering[frames]
        alpha = forward[: len(density)]
        valid = _forward(
            alpha, density, scale, initial, runs, run_weight, blocks, block_sources, block_weight, leave, room, share,
            least, least_scale,
        )  # fmt: skip
        end = (alpha[-1, :S] * final).sum() if valid else 0.0
        if end > least_scale * scale[-1]:
            beta[:S] = final / end
            of_recording[:] = 0
            valid = _backward(
                alpha, density, scale, initial, beta, onward, runs, run_weight, of_recording, few,
                blocks, block_sources, transposed, enter, room, share, least, off,
            )  # fmt: skip
            ends[u] = end / scale[-1] if valid else 0.0
        if ends[u] > 0:
            counts += of_recording
        else:
            leave[:] = 0
    return counts, leaving, entering, scales, ends


@compiled_to_rounding
def _forward(
    alpha: Array, density: Array, scale: Array, initial: Array, runs: Unsigned, run_weight: Array,
    blocks: Unsigned, sources: Unsigned, block_weight: Array, leave: Array, room: Array, share: Array,
    least: float, least_scale: float,
) -> bool:  # fmt: skip
    """Fill in forward probabilities, scaled by the sum of the frame before, and their sums; return whether valid."""
    for t in range(len(alpha)):
        alpha[t] = least
        if t == 0:
            alpha[t, : len(initial)] = initial
        else:
            _forward_runs(alpha, t, runs, run_weight)
            _forward_blocks(alpha, t, blocks, sources, block_weight, leave, room, share, SHARE * least)
        scale[t] = _emit(alpha, density, t, 1 / scale[t - 1] if t > 0 else 1.0, least)
        if not least_scale < scale[t] < MOST_SCALE:
            return False
    return True


@compiled_to_rounding
def _backward(
    alpha: Array, density: Array, scale: Array, initial: Array, beta: Array, onward: Array, runs: Unsigned,
    run_weight: Array, counts: Array, few: Array, blocks: Unsigned, sources: Unsigned, transposed: Array, enter: Array,
    room: Array, share: Array, least: float, off: float,
) -> bool:  # fmt: skip
    """Replace densities by posteriors, and add to the counts; return whether all are valid."""
    few[:] = least
    for t in range(len(alpha) - 1, -1, -1):
        total = _close(density, alpha, t, beta, onward, 1 / scale[t - 1] if t > 0 else 1.0, least)
        if not abs(total - 1) < off:
            return False
        if t > 0:
            beta[:] = least
            _backward_runs(alpha, t - 1, onward, beta, runs, run_weight, few)
            _backward_blocks(onward, beta, blocks, sources, transposed, enter, t - 1, room, share, SHARE * least)
        if t % FRAMES_SUMMED == 0:
            counts += few
            few[:] = least
    begun = 0.0
    for i in range(len(initial)):
        begun += initial[i] * onward[i]
    return abs(begun - 1) < off


@compiled_to_rounding
def _forward_runs(alpha: Array, t: int, runs: Unsigned, weight: Array) -> None:
    for r in range(len(runs)):
        target, source, length, first = runs[r, 0], runs[r, 1], runs[r, 2], runs[r, 3]
        for i in range(length):
            alpha[t, target + i] += weight[first + i] * alpha[t - 1, source + i]


@compiled_to_rounding
def _forward_blocks(
    alpha: Array, t: int, blocks: Unsigned, sources: Unsigned, weight: Array, leaving: Array, room: Array, share: Array,
    least: float,
) -> None:  # fmt: skip
    for b in range(len(blocks)):
        target, targets, first, count = blocks[b, 0], blocks[b, 1], blocks[b, 2], blocks[b, 3]
        for s in range(count):
            leaving[t - 1, first + s] = alpha[t - 1, sources[first + s]]
        total = _shares(leaving, t - 1, first, count, share, least)
        _times(share, count, weight, first, room)
        for i in range(targets):
            alpha[t, target + i] += total * room[i]


@compiled_to_rounding
def _density(root: float) -> float:
    """Return the eighth power of a root, in double precision."""
    square = np.float64(root) * np.float64(root)
    return square * square * (square * square)


@compiled_to_rounding
def _emit(alpha: Array, emission: Array, t: int, scale: float, least: float) -> float:
    """Multiply the forward probabilities of a frame by its densities and a scale; return their sum."""
    total = 0.0
    for i in range(emission.shape[1]):
        product = np.float64(alpha[t, i]) * (_density(emission[t, i]) * scale)
        kept = product if product > least else least
        alpha[t, i] = kept
        total += kept
    return total


@compiled_to_rounding
def _close(emission: Array, alpha: Array, t: int, beta: Array, onward: Array, scale: float, least: float) -> float:
    """Replace the densities of a frame by its posteriors, and fill in backward probabilities times densities; return
    the sum of the posteriors.
    """
    total = 0.0
    for i in range(emission.shape[1]):
        back = np.float64(beta[i])
        product = back * (_density(emission[t, i]) * scale)
        onward[i] = product if product > least else least
        posterior = alpha[t, i] * back
        total += posterior
        emission[t, i] = posterior if posterior > LEAST_POSTERIOR else 0.0
    return total


@compiled_to_rounding
def _backward_runs(
    alpha: Array, t: int, onward: Array, beta: Array, runs: Unsigned, weight: Array, counts: Array
) -> None:
    for r in range(len(runs)):
        target, source, length, first = runs[r, 0], runs[r, 1], runs[r, 2], runs[r, 3]
        for i in range(length):
            beta[source + i] += weight[first + i] * onward[target + i]
        for i in range(length):
            counts[first + i] += alpha[t, source + i] * onward[target + i]


@compiled_to_rounding
def _backward_blocks(
    onward: Array, beta: Array, blocks: Unsigned, sources: Unsigned, transposed: Array, entering: Array, t: int,
    room: Array, share: Array, least: float,
) -> None:  # fmt: skip
    start = np.uintp(0)
    for b in range(len(blocks)):
        target, targets, first, count = blocks[b, 0], blocks[b, 1], blocks[b, 2], blocks[b, 3]
        for i in range(targets):
            entering[t, start + i] = onward[target + i]
        total = _shares(entering, t, start, targets, share, least)
        _times(share, targets, transposed, start, room)
        for s in range(count):
            beta[sources[first + s]] += total * room[s]
        start += targets


@compiled_to_rounding
def _shares(values: Array, t: int, first: Any, count: Any, share: Array, least: float) -> float:
    """Fill in values of a row divided by their sum, 0 where that is less than ``least``; return the sum."""
    total = 0.0
    for i in range(count):
        total += values[t, first + i]
    scale = 1 / total if total > 0 else 0.0
    for i in range(count):
        part = values[t, first + i] * scale
        share[i] = part if part > least else 0.0
    return total


@compiled_to_rounding
def _times(row: Array, count: Any, matrix: Array, first: Any, product: Array) -> None:
    """Fill in the product of a row with as many rows of a matrix, four of them at a time."""
    wide = matrix.shape[1]
    product[:] = 0
    for r in range(0, count // 4 * 4, 4):
        a, b, c, d = row[r], row[r + 1], row[r + 2], row[r + 3]
        w, x, y, z = first + r, first + r + 1, first + r + 2, first + r + 3
        for i in range(wide):
            product[i] += a * matrix[w, i] + b * matrix[x, i] + c * matrix[y, i] + d * matrix[z, i]
    for r in range(count // 4 * 4, count):
        for i in range(wide):
            product[i] += row[r] * matrix[first + r, i]
