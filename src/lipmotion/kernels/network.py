"""State posteriors and expected arc counts of networks of states, by forward–backward with scaled probabilities.

All is in one precision, single or double, but for products and sums that are followed by a division. Probabilities
under a least one are raised to it, never set to 0: so no product is denormal, which would be many times slower, and
forward probabilities are upper bounds.

Let N be the sum over the states of a frame of forward times backward probabilities, divided by the likelihood that was
computed: in the last frame it is 1. From each frame to the one before, and from the first frame to the beginning (whose
forward probabilities are the initial ones), N changes by

    + what was raised backward, times the forward probabilities: negligible, as these sum to ``MAX_SCALE`` at most
    − what was raised forward, times the backward probabilities
    − what was lost backward (where blocks are multiplied, or an arc underflows), times the forward probabilities

So if no N is under 1 − δ, the last two sum to δ at most, over all frames. They bound what is wrong: the likelihood is
too great by a share of δ at most, and the errors of the posteriors of a frame sum to 3 δ at most, but for rounding. A
recording with a smaller N is left to the caller.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.arcs import PADDING_ROWS, ArcLayout, lay_out_arcs
from lipmotion.kernels.compiler import compile_to_rounding
from lipmotion.kernels.forward_backward import log_forward_backward

Index = NDArray[np.intp]
Unsigned = NDArray[np.uintp]  # unsigned, as loops over indices that may be negative are not vectorised
Array = NDArray[Any]  # float32 or float64
CHUNK = 16  # runs are padded to multiples of this, so that vectorised loops over them have no remainder
FRAMES_AT_ONCE = 256  # frames whose roots are taken at once: they stay in the cache
LOWEST_ROOT = -80.0
"""Least logarithm of a density's eighth root: exp of less is denormal in single precision, which is slow."""
MIN_ROOT = 1.9e-35  # exp(-80): densities up to its eighth power are set to 0
MIN_JOINT = 1e-4
"""Least root of a frame's best joint density, relative to the product of the chains' best ones: where it is less, joint
densities are computed from sums of logarithms, as factors under e^LOWEST_ROOT may count."""
LIMITS = {np.dtype(np.float32): (1e-24, 1e-12, 1e-4), np.dtype(np.float64): (1e-140, 1e-100, 1e-10)}
"""By precision: ``floor``, ``min_scale`` and ``off`` of ``_forward_backward``."""
MIN_POSTERIOR = 1e-12  # smaller posteriors are set to 0
SHARE = 1e-6
"""Shares of a block's sources are set to 0 under this times the least probability: less than what is raised."""
MAX_SCALE = 1e6  # greatest scale of a frame. With a smaller one no share of forward probabilities is set to 0.
FRAMES_SUMMED = 256  # frames that are summed in the kernel's precision, before they are added in double precision


class NetworkPosteriors(NamedTuple):
    """Posteriors of a recording in a network.

    posterior      : [shape=(T, S)], of the states by place (``kernels.arcs``); those under 1e-12 may be 0
    counts         : [shape=(E,)], expected number of times that each arc is followed
    log_likelihood : -inf where there is no path: then everything else is 0

    Guaranteed but for rounding, however improbable a path is at first: the likelihood is right to a share of δ, and the
    errors of the posteriors of a frame, or of the counts of a step from frame to frame, sum to 3 δ at most: δ is 1e-4
    for log densities in single precision, 1e-10 for those in double precision (``LIMITS``).
    """

    posterior: NDArray[Any]
    counts: Array
    log_likelihood: float


class _Weights(NamedTuple):
    """The probabilities of arcs relative to the greatest, whose logarithm is ``best``, in the kernels' forms.

    runs       : of run arcs, each run padded with zeros to a multiple of ``CHUNK`` [shape=(M,)]
    run_bounds : [shape=(R, 4)], first target's place, first source's place, padded length, position in ``runs``
    unpadded   : [shape=(N,)], the positions in ``runs`` of the arcs that are no padding
    blocks, transposed : of blocks, sources as rows, and targets as rows
    """

    best: float
    runs: Array
    run_bounds: Unsigned
    unpadded: Index
    blocks: Array
    transposed: Array


class ForwardBackwardNetwork(NamedTuple):
    """A network laid out for forward–backward: ``arc_from``, ``arc_start`` as in ``kernels.paths.NetworkArrays``."""

    arc_from: Index
    arc_start: Index
    layout: ArcLayout

    @classmethod
    def of(cls, arc_from: Index, arc_start: Index) -> ForwardBackwardNetwork:
        """Return the network of these arcs."""
        return cls(arc_from, arc_start, lay_out_arcs(arc_from, arc_start))

    def posteriors(
        self,
        arc_log: NDArray[np.floating[Any]],
        log_initial: NDArray[np.floating[Any]],
        log_emissions: Sequence[NDArray[np.floating[Any]]],
        columns: Sequence[Index],
    ) -> NetworkPosteriors:
        """Return the posteriors of a recording, which may end in any state; densities are products, a factor a chain.

        arc_log, log_initial : log probabilities of arcs [shape=(E,)], and of beginning in each state [shape=(S,)]
        log_emissions : one or more [shape=(T, G_c)], all of one precision, finite or -inf; the log density of the state
            at place s is the sum over chains of ``log_emissions[c][:, columns[c][s]]``
        columns       : of each chain [shape=(S,)]
        What is computed is ``log_forward_backward``: by ``_forward_backward`` in the precision of ``log_emissions``;
        where that would lose what counts, in double precision, and at last in logarithms.
        Cost: O(T·E), and exponentials of densities; in double precision twice, in logarithms fifty times as slow.
        """
        precision, layout = log_emissions[0].dtype, self.layout
        log_arcs, log_first = arc_log.astype(np.float64), log_initial.astype(np.float64)
        weights, (initial, best_first) = _weigh(layout, log_arcs), _probabilities(log_first[layout.order])
        for kind in dict.fromkeys((precision, np.dtype(np.float64))):
            logs = [log.astype(kind, copy=False) for log in log_emissions]
            root, best = _products(logs, columns)
            run_counts, leaving, entering, scales, is_enough = _forward_backward(
                root, initial, weights.run_bounds, weights.runs.astype(kind),
                layout.blocks.astype(np.uintp), layout.block_sources.astype(np.uintp),
                weights.blocks.astype(kind), weights.transposed.astype(kind), *LIMITS[kind],
            )  # fmt: skip
            if is_enough:
                counts, start = np.zeros(len(self.arc_from)), 0
                counts[layout.run_arcs] = run_counts[weights.unpadded] * weights.runs[weights.unpadded]
                for _, targets, place, sources in layout.blocks:  # one matrix product each
                    arcs = slice(place, place + sources), slice(0, targets)
                    pairs = leaving[:, arcs[0]].T @ entering[:, start : start + targets]
                    counts[layout.block_arcs[arcs]] = pairs * weights.blocks[arcs]
                    start += targets
                log_likelihood = (np.log(scales) + best).sum() + best_first + (len(root) - 1) * weights.best
                return NetworkPosteriors(root, counts, float(log_likelihood))
        arc_to = np.repeat(np.arange(len(self.arc_start)), np.diff(self.arc_start, append=len(self.arc_from)))
        parts = _joint(logs, columns).take(layout.place, axis=1), self.arc_from, arc_to, log_arcs
        log_posterior, counts, log_likelihood = log_forward_backward(log_first, *parts, np.zeros(len(log_first)))
        return NetworkPosteriors(np.exp(log_posterior)[:, layout.order].astype(precision), counts, log_likelihood)


def _roots(log_density: NDArray[np.floating[Any]]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return eighth roots of densities relative to the best of each frame, e⁻⁸⁰ at least, and the best's logarithm."""
    best = log_density.max(axis=1)
    best[~np.isfinite(best)] = 0
    root = log_density - best[:, None]
    root *= root.dtype.type(1 / 8)
    return np.exp(np.maximum(root, LOWEST_ROOT, out=root), out=root), best


def _products(
    log_densities: Sequence[NDArray[np.floating[Any]]], columns: Sequence[Index]
) -> tuple[NDArray[Any], Array]:
    """Return roots of joint densities, by place, relative to each frame's best, and its logarithm (-inf: all are 0)."""
    firsts = np.cumsum([0, *(log.shape[1] for log in log_densities[:-1])])
    shifted = (np.stack(columns) + firsts[:, None]).astype(np.uint32)
    frames = len(log_densities[0])
    joint, best = np.empty((frames, shifted.shape[1]), log_densities[0].dtype), np.empty(frames)
    for start in range(0, frames, FRAMES_AT_ONCE):
        of_recording = slice(start, start + FRAMES_AT_ONCE)
        if len(log_densities) == 1:
            joint[of_recording], best[of_recording] = _roots(log_densities[0][of_recording].take(columns[0], axis=1))
            continue
        roots, bests = zip(*(_roots(log[of_recording]) for log in log_densities), strict=True)
        _fill_joint_roots(np.hstack(roots), shifted, joint[of_recording], best[of_recording])
        far = start + np.flatnonzero(best[of_recording] < MIN_JOINT)
        with np.errstate(divide="ignore"):
            best[of_recording] = 8 * np.log(best[of_recording]) + np.sum(bests, axis=0, dtype=np.float64)
        if len(far):
            joint[far], best[far] = _roots(_joint([log[far] for log in log_densities], columns))
    return joint, best


def _joint(log_densities: Sequence[NDArray[np.floating[Any]]], columns: Sequence[Index]) -> Array:
    """Return joint log densities [shape=(T, S)], by place."""
    factors = (log[:, column].astype(np.float64) for log, column in zip(log_densities, columns, strict=True))
    return np.asarray(sum(factors))


def _probabilities(log: Array) -> tuple[Array, float]:
    """Return probabilities relative to the greatest, and the logarithm of the greatest."""
    best = float(log.max())
    best = best if np.isfinite(best) else 0.0
    return np.exp(log - best), best


def _weigh(layout: ArcLayout, arc_log: Array) -> _Weights:
    relative, best = _probabilities(arc_log)
    blocks = relative[layout.block_arcs]
    blocks[layout.block_arcs < 0] = 0
    width = -(-layout.blocks[:, 3].max(initial=0) // PADDING_ROWS) * PADDING_ROWS
    transposed = [np.empty((0, width))]
    for _, targets, first, sources in layout.blocks:
        matrix = np.zeros((targets, width))
        matrix[:, :sources] = blocks[first : first + sources, :targets].T
        transposed.append(matrix)
    bounds = layout.runs.copy()
    bounds[:, 2] = -(-bounds[:, 2] // CHUNK) * CHUNK
    bounds[:, 3] = np.cumsum(bounds[:, 2]) - bounds[:, 2]
    runs = np.zeros(bounds[:, 2].sum())
    unpadded = np.arange(len(layout.run_arcs)) + np.repeat(bounds[:, 3] - layout.runs[:, 3], layout.runs[:, 2])
    runs[unpadded] = relative[layout.run_arcs]
    return _Weights(best, runs, bounds.astype(np.uintp), unpadded, blocks, np.concatenate(transposed))


@compile_to_rounding
def _fill_joint_roots(roots: Array, columns: NDArray[np.uint32], joint: Array, best: Array) -> None:
    """Fill in the roots of joint densities relative to the best of each frame, and the root of the best [shape=(T,)].

    roots   : [shape=(T, G)], of all chains side by side, each relative to the chain's best
    columns : [shape=(C, S)], for each chain, the column of the state at each place
    """
    states = columns.shape[1]
    factor, product, tops = np.empty(roots.shape[1], roots.dtype), np.empty(states), np.empty(8)
    for t in range(len(roots)):
        for g in range(len(factor)):
            factor[g] = roots[t, g] if roots[t, g] > MIN_ROOT else 0.0
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
            row[s] = root if root > MIN_ROOT else 0.0


@compile_to_rounding
def _forward_backward(
    emission: Array, initial: Array, runs: Unsigned, run_weight: Array,
    blocks: Unsigned, block_sources: Unsigned, block_weight: Array, transposed: Array,
    floor: float, min_scale: float, off: float,
) -> tuple[Array, Array, Array, Array, bool]:  # fmt: skip
    """Return the expected counts of a recording in a network; ``emission`` is overwritten by the posteriors.

    emission : [shape=(T, S)], by place: eighth roots of densities relative to each frame's best; its precision is used
    initial  : [shape=(S,)], in double precision, the greatest 1
    runs ... transposed : of ``kernels.arcs.ArcLayout`` and ``_Weights``
    floor, min_scale, off : least probability, least scale of a frame, and largest error of N (see above)
    Returns the expected count of each run arc divided by its weight [shape=(N,)]; the forward probabilities of all
    blocks' sources and the backward ones of their targets in the next frame, whose products summed over time give the
    counts of block arcs [shapes=(T, ...)]; each frame's scale [shape=(T,)]; and whether the precision is enough.
    """
    T, S = emission.shape
    counts, scale = np.zeros(len(run_weight)), np.ones(T)
    leave, enter = np.zeros((T, len(block_sources))), np.zeros((T, int(blocks[:, 1].sum())))
    alpha, few = np.empty((T, S + CHUNK), emission.dtype), np.empty(len(counts), emission.dtype)
    beta, onward = np.zeros(S + CHUNK, emission.dtype), np.zeros(S + CHUNK, emission.dtype)
    room = np.empty(max(block_weight.shape[1], transposed.shape[1]), emission.dtype)
    share = np.empty(max(len(block_weight), len(transposed)), emission.dtype)
    valid = _forward(
        alpha, emission, scale, initial, runs, run_weight, blocks, block_sources, block_weight, leave, room, share,
        floor, min_scale,
    )  # fmt: skip
    if valid:
        beta[:S] = 1 / scale[-1]
        valid = _backward(
            alpha, emission, scale, initial, beta, onward, runs, run_weight, counts, few,
            blocks, block_sources, transposed, enter, room, share, floor, off,
        )  # fmt: skip
    return counts, leave, enter, scale, valid


@compile_to_rounding
def _forward(
    alpha: Array, density: Array, scale: Array, initial: Array, runs: Unsigned, run_weight: Array,
    blocks: Unsigned, sources: Unsigned, block_weight: Array, leave: Array, room: Array, share: Array,
    floor: float, min_scale: float,
) -> bool:  # fmt: skip
    """Fill in forward probabilities, scaled by the sum of the frame before, and their sums; return whether valid."""
    for t in range(len(alpha)):
        alpha[t] = floor
        if t == 0:
            alpha[t, : len(initial)] = initial
        for r in range(len(runs) if t > 0 else 0):
            target, source, length, first = runs[r, 0], runs[r, 1], runs[r, 2], runs[r, 3]
            for i in range(length):
                alpha[t, target + i] += run_weight[first + i] * alpha[t - 1, source + i]
        for b in range(len(blocks) if t > 0 else 0):
            target, targets, first, count = blocks[b, 0], blocks[b, 1], blocks[b, 2], blocks[b, 3]
            for s in range(count):
                leave[t - 1, first + s] = alpha[t - 1, sources[first + s]]
            total = _shares(leave, t - 1, first, count, share, SHARE * floor)
            _times(share, count, block_weight, first, room)
            for i in range(targets):
                alpha[t, target + i] += total * room[i]
        scale[t] = _emit(alpha, density, t, 1 / scale[t - 1] if t > 0 else 1.0, floor)
        if not min_scale < scale[t] < MAX_SCALE:
            return False
    return True


@compile_to_rounding
def _backward(
    alpha: Array, density: Array, scale: Array, initial: Array, beta: Array, onward: Array, runs: Unsigned,
    run_weight: Array, counts: Array, few: Array, blocks: Unsigned, sources: Unsigned, transposed: Array, enter: Array,
    room: Array, share: Array, floor: float, off: float,
) -> bool:  # fmt: skip
    """Replace densities by posteriors, and add to the counts; return whether all are valid."""
    few[:] = floor
    for t in range(len(alpha) - 1, -1, -1):
        total = _close(density, alpha, t, beta, onward, 1 / scale[t - 1] if t > 0 else 1.0, floor)
        if not abs(total - 1) < off:
            return False
        beta[:] = floor
        for r in range(len(runs) if t > 0 else 0):
            target, source, length, first = runs[r, 0], runs[r, 1], runs[r, 2], runs[r, 3]
            for i in range(length):
                beta[source + i] += run_weight[first + i] * onward[target + i]
            for i in range(length):
                few[first + i] += alpha[t - 1, source + i] * onward[target + i]
        start = np.uintp(0)
        for b in range(len(blocks) if t > 0 else 0):
            target, targets, first, count = blocks[b, 0], blocks[b, 1], blocks[b, 2], blocks[b, 3]
            for i in range(targets):
                enter[t - 1, start + i] = onward[target + i]
            total = _shares(enter, t - 1, start, targets, share, SHARE * floor)
            _times(share, targets, transposed, start, room)
            for s in range(count):
                beta[sources[first + s]] += total * room[s]
            start += targets
        if t % FRAMES_SUMMED == 0:
            counts += few
            few[:] = floor
    begun = (initial * onward[: len(initial)]).sum()
    return abs(begun - 1) < off


@compile_to_rounding
def _density(root: float) -> float:
    """Return the eighth power of a root, in double precision."""
    square = np.float64(root) * np.float64(root)
    return square * square * (square * square)


@compile_to_rounding
def _emit(alpha: Array, emission: Array, t: int, scale: float, floor: float) -> float:
    """Multiply the forward probabilities of a frame by its densities and a scale; return their sum."""
    total = 0.0
    for i in range(emission.shape[1]):
        product = np.float64(alpha[t, i]) * (_density(emission[t, i]) * scale)
        value = product if product > floor else floor
        alpha[t, i] = value
        total += value
    return total


@compile_to_rounding
def _close(emission: Array, alpha: Array, t: int, beta: Array, onward: Array, scale: float, floor: float) -> float:
    """Replace a frame's densities by posteriors, fill in backward probabilities times densities; return their sum."""
    total = 0.0
    for i in range(emission.shape[1]):
        back = np.float64(beta[i])
        product = back * (_density(emission[t, i]) * scale)
        onward[i] = product if product > floor else floor
        posterior = alpha[t, i] * back
        total += posterior
        emission[t, i] = posterior if posterior > MIN_POSTERIOR else 0.0
    return total


@compile_to_rounding
def _shares(values: Array, t: int, first: Any, count: Any, share: Array, floor: float) -> float:
    """Fill in values of a row divided by their sum, 0 where that is less than ``floor``; return the sum."""
    total = 0.0
    for i in range(count):
        total += values[t, first + i]
    scale = 1 / total if total > 0 else 0.0
    for i in range(count):
        part = values[t, first + i] * scale
        share[i] = part if part > floor else 0.0
    return total


@compile_to_rounding
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
