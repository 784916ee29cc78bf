"""Forward–backward through networks, compiled, with scaled probabilities.

They are in double precision; products with blocks, whose terms are made alike first, in the evidence's own. Nothing
under ``LEAST`` is kept, so no product is denormal, which would be many times slower; and a state without forward
probability gets no backward one, which else might grow without limit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiled.compiler import compiled_to_rounding

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Unsigned = NDArray[np.uintp]
"""Signed indices might count from the end, which keeps loops from being vectors."""
LEAST, LEAST_POSTERIOR, LEAST_SHARE = 1e-140, 1e-12, 1e-25


LEAST_ROOT = 1.9e-35
"""exp(-80): a density not above its eighth power counts as none."""


@compiled_to_rounding
def products(roots: Array, columns: Index) -> tuple[Array, Array]:
    """Return the roots of joint densities relative to the best of each frame, and its root.

    roots   : float32 or float64 [shape=(T, G)], of all chains side by side, each relative to its own best
    columns : [shape=(C, S)], by place, those of each chain
    Returns [shape=(T, S)], as precise as ``roots``, and [shape=(T,)]; where all are nothing, 0.
    """
    joint, best = np.empty((len(roots), columns.shape[1]), roots.dtype), np.empty(len(roots))
    factor, product = np.empty(roots.shape[1]), np.empty(columns.shape[1])
    for t in range(len(roots)):
        for g in range(len(factor)):
            factor[g] = roots[t, g] if roots[t, g] > LEAST_ROOT else 0.0
        product[:] = 1.0
        for c in range(len(columns)):
            for s in range(len(product)):
                product[s] *= factor[columns[c, s]]
        best[t] = product.max()
        scale = 1 / best[t] if best[t] > 0 else 0.0
        for s in range(len(product)):
            root = product[s] * scale
            joint[t, s] = root if root > LEAST_ROOT else 0.0
    return joint, best


@compiled_to_rounding
def forward_backward(
    emission: Array, edges: Index, initial: Array, final: Array, runs: Unsigned, run_weight: Array,
    blocks: Index, block_sources: Index, block_weight: Array, turned: Array,
) -> tuple[Array, Array, Array, Array, Array]:  # fmt: skip
    """Return what recordings say about a network; ``emission`` becomes the posteriors.

    emission     : float32 or float64 [shape=(T, S)], by place, one recording after the other: the eighth roots of
                   densities relative to the best of each frame
    edges        : [shape=(U + 1,)], where each begins, and T
    runs ... block_weight : of the layout and its weights (``kernels.arcs``)
    turned       : the weights of blocks, targets as rows
    Returns how often each run arc is followed, divided by its weight [shape=(N,)]; the forward probabilities of all
    blocks' sources and, of the next frame, backward ones of their targets, whose products over time count block arcs
    [shapes=(T, ...)]; the scale of each frame [shape=(T,)] and of each end [shape=(U,)], 0 where there is no path:
    their product is the likelihood.
    """
    T, S = emission.shape
    targets = 0
    for b in range(len(blocks)):
        targets += blocks[b, 1]
    counts, scales, ends = np.zeros(len(run_weight)), np.ones(T), np.zeros(len(edges) - 1)
    leaving, entering = np.zeros((T, len(block_sources))), np.zeros((T, targets))
    longest = 0
    for u in range(len(ends)):
        longest = max(longest, edges[u + 1] - edges[u])
    forward, beta, onward = np.empty((longest, S)), np.empty(S), np.empty(S)
    room = np.empty(max(block_weight.shape[1], turned.shape[1]), block_weight.dtype)
    share = np.empty(max(len(block_weight), len(turned)), block_weight.dtype)
    for u in range(len(ends)):
        frames = slice(edges[u], edges[u + 1])
        density, scale, leave, enter = emission[frames], scales[frames], leaving[frames], entering[frames]
        alpha = forward[: len(density)]
        for t in range(len(alpha)):
            if t == 0:
                alpha[t] = initial
            else:
                alpha[t] = 0
                _forward_runs(alpha, t, runs, run_weight)
                _forward_blocks(alpha[t - 1], alpha[t], blocks, block_sources, block_weight, leave[t - 1], room, share)
            scale[t] = _emit(alpha, density, t)
            if scale[t] <= 0:
                break
        ends[u] = (alpha[-1] * final).sum() if scale.min() > 0 else 0.0
        if ends[u] <= 0:
            ends[u] = 0
            density[:], leave[:] = 0, 0
            continue
        beta[:] = final / ends[u]
        for t in range(len(alpha) - 1, -1, -1):
            _close(density, alpha, t, beta, onward, 1 / scale[t])
            if t > 0:
                beta[:] = 0
                _backward_runs(alpha[t - 1], onward, beta, runs, run_weight, counts)
                _backward_blocks(onward, beta, blocks, block_sources, turned, enter[t - 1], room, share)
    return counts, leaving, entering, scales, ends


@compiled_to_rounding
def _forward_runs(alpha: Array, t: int, runs: Unsigned, weight: Array) -> None:
    into, out = alpha[t], alpha[t - 1]
    for r in range(len(runs)):
        target, source, length, first = runs[r, 0], runs[r, 1], runs[r, 2], runs[r, 3]
        for i in range(length):
            into[target + i] += weight[first + i] * out[source + i]


@compiled_to_rounding
def _forward_blocks(
    before: Array, after: Array, blocks: Index, sources: Index, weight: Array, leaving: Array, room: Array, share: Array
) -> None:
    for b in range(len(blocks)):
        target, targets, first, count = blocks[b]
        enter, leave = room[: weight.shape[1]], leaving[first : first + count]
        for s in range(count):
            leave[s] = before[sources[first + s]]
        total = _times(leave, weight[first : first + count], share, enter)
        into = after[target : target + targets]
        for i in range(len(into)):
            into[i] += total * enter[i]


@compiled_to_rounding
def _density(root: float) -> float:
    """Return the eighth power, in double precision whatever the root's."""
    square = np.float64(root) * np.float64(root)
    return square * square * (square * square)


@compiled_to_rounding
def _emit(alpha: Array, emission: Array, t: int) -> float:
    """Multiply by the densities, make the sum 1; return what it was."""
    total = 0.0
    for i in range(alpha.shape[1]):
        density = _density(emission[t, i])
        alpha[t, i] *= density if density > LEAST else 0.0
        total += alpha[t, i]
    scale = 1 / total if total > 0 else 0.0
    for i in range(alpha.shape[1]):
        alpha[t, i] = alpha[t, i] * scale if alpha[t, i] * scale > LEAST else 0.0
    return total


@compiled_to_rounding
def _close(emission: Array, alpha: Array, t: int, beta: Array, onward: Array, scale: float) -> None:
    """Fill in what is handed back from this frame; make of its densities its posteriors."""
    for i in range(len(beta)):
        back = beta[i] if alpha[t, i] > 0 and beta[i] > LEAST else 0.0
        handed = back * _density(emission[t, i]) * scale
        onward[i] = handed if handed > LEAST else 0.0
        posterior = alpha[t, i] * back
        emission[t, i] = posterior if posterior > LEAST_POSTERIOR else 0.0


@compiled_to_rounding
def _backward_runs(alpha: Array, onward: Array, beta: Array, runs: Unsigned, weight: Array, counts: Array) -> None:
    for r in range(len(runs)):
        target, source, length, first = runs[r, 0], runs[r, 1], runs[r, 2], runs[r, 3]
        for i in range(length):
            beta[source + i] += weight[first + i] * onward[target + i]
        for i in range(length):
            counts[first + i] += alpha[source + i] * onward[target + i]


@compiled_to_rounding
def _times(row: Array, matrix: Array, share: Array, product: Array) -> float:
    """Multiply a row, relative to its sum, by a matrix, four of its rows at a time; return that sum.

    share : room for the row, in the matrix's precision
    """
    total = 0.0
    for r in range(len(row)):
        total += row[r]
    scale = 1 / total if total > 0 else 0.0
    for r in range(len(row)):
        share[r] = row[r] * scale if row[r] * scale > LEAST_SHARE else 0.0
    product[:] = 0
    whole = len(row) // 4 * 4
    for r in range(0, whole, 4):
        a, b, c, d = share[r], share[r + 1], share[r + 2], share[r + 3]
        for i in range(len(product)):
            product[i] += a * matrix[r, i] + b * matrix[r + 1, i] + c * matrix[r + 2, i] + d * matrix[r + 3, i]
    for r in range(whole, len(row)):
        a = share[r]
        for i in range(len(product)):
            product[i] += a * matrix[r, i]
    return total


@compiled_to_rounding
def _backward_blocks(
    onward: Array, beta: Array, blocks: Index, sources: Index, turned: Array, entering: Array, room: Array, share: Array
) -> None:
    start = 0
    for b in range(len(blocks)):
        target, targets, first, count = blocks[b]
        back, hand = room[: turned.shape[1]], entering[start : start + targets]
        hand[:] = onward[target : target + targets]
        total = _times(hand, turned[start : start + targets], share, back)
        for s in range(count):
            beta[sources[first + s]] += total * back[s]
        start += targets
