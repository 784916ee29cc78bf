"""State posteriors and expected arc counts of networks of states, by forward–backward."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.choice import numba_works
from lipmotion.kernels.sequences.arcs import PADDED, ArcLayout, ArcWeights, arc_layout, arc_weights
from lipmotion.kernels.sequences.forward_backward import log_forward_backward

Index = NDArray[np.intp]
Array = NDArray[np.float64]
CHUNK = 16
"""Runs of arcs are padded to multiples of this."""
FRAMES_AT_ONCE = 256
"""Frames whose roots are taken at once: they stay in the cache."""
LOWEST_ROOT = -80.0
"""Least logarithm of a density's eighth root: exp of less is denormal in single precision, which is slow."""
LEAST_JOINT = 1e-4
"""Least root of a frame's best joint density, relative to the product of the chains' best ones: where it is less, joint
densities are computed from sums of logarithms, as factors under e^LOWEST_ROOT may count."""
LIMITS = {np.dtype(np.float32): (1e-24, 1e-12, 1e-4), np.dtype(np.float64): (1e-140, 1e-100, 1e-10)}
"""By precision: ``least``, ``least_scale`` and ``off`` of the compiled kernel."""


class NetworkPosteriors(NamedTuple):
    """Posteriors of recordings in a network.

    posterior      : [shape=(T, S)], of the states by place (``sequences.arcs``), all recordings concatenated; those
        under 1e-12 may be 0
    counts         : [shape=(E,)], expected number of times that each arc is followed, over all recordings
    log_likelihood : [shape=(U,)], of each recording; -inf where there is no path: then its posteriors are 0

    Guaranteed but for rounding, however improbable a path is at first: a likelihood is right to a share of δ, and the
    errors of the posteriors of a frame, or of the counts of a step from frame to frame, sum to 3 δ at most: δ is 1e-4
    for log densities in single precision, 1e-10 for those in double precision (``LIMITS``).
    """

    posterior: NDArray[Any]
    counts: Array
    log_likelihood: Array


class Chunks(NamedTuple):
    """Runs of arcs, each padded to a multiple of ``CHUNK``.

    runs   : [shape=(R, 4)], first target's place, first source's place, padded length, position in ``weight``
    weight : [shape=(M,)], the probabilities of arcs, 0 for padding
    arcs   : [shape=(N,)], the positions in ``weight`` of the arcs that are no padding
    """

    runs: NDArray[np.uintp]
    weight: Array
    arcs: Index

    @classmethod
    def of(cls, layout: ArcLayout, weights: ArcWeights) -> Chunks:
        """Return the padded runs of a layout."""
        runs = layout.runs.copy()
        runs[:, 2] = -(-runs[:, 2] // CHUNK) * CHUNK
        runs[:, 3] = np.cumsum(runs[:, 2]) - runs[:, 2]
        weight = np.zeros(runs[:, 2].sum())
        arcs = np.arange(len(weights.runs)) + np.repeat(runs[:, 3] - layout.runs[:, 3], layout.runs[:, 2])
        weight[arcs] = weights.runs
        return cls(runs.astype(np.uintp), weight, arcs)


class ForwardBackwardNetwork(NamedTuple):
    """A network prepared for forward–backward.

    arc_from, arc_log, arc_start, log_initial, log_final : as in ``kernels.sequences.arcs.NetworkArrays``
    layout     : of the arcs
    best_arc   : logarithm of the greatest probability of an arc
    weights    : the probabilities of arcs relative to that, in the layout
    transposed : those of blocks, targets as rows, sources as columns
    chunks     : those of runs
    """

    arc_from: Index
    arc_log: Array
    arc_start: Index
    log_initial: Array
    log_final: Array
    layout: ArcLayout
    best_arc: float
    weights: ArcWeights
    transposed: Array
    chunks: Chunks

    @classmethod
    def of(
        cls,
        arc_from: Index,
        arc_log: NDArray[np.floating[Any]],
        arc_start: Index,
        log_initial: NDArray[np.floating[Any]],
        log_final: NDArray[np.floating[Any]],
    ) -> ForwardBackwardNetwork:
        """Return a network prepared for forward–backward; parameters as in ``kernels.sequences.arcs.NetworkArrays``."""
        layout = arc_layout(arc_from, arc_start)
        logs, initial, final = (log.astype(np.float64) for log in (arc_log, log_initial, log_final))
        return cls(arc_from, logs, arc_start, initial, final, layout, *_weighted(layout, logs))

    def with_arcs(
        self, arc_log: NDArray[np.floating[Any]], log_initial: NDArray[np.floating[Any]]
    ) -> ForwardBackwardNetwork:
        """Return the network with other probabilities of arcs [shape=(E,)] and of beginnings [shape=(S,)]."""
        logs, initial = arc_log.astype(np.float64), log_initial.astype(np.float64)
        best_arc, weights, transposed, chunks = _weighted(self.layout, logs)
        changed = self._replace(best_arc=best_arc, weights=weights, transposed=transposed, chunks=chunks)
        return changed._replace(arc_log=logs, log_initial=initial)

    def posteriors(self, log_emission: NDArray[np.floating[Any]], columns: Index, frames: Index) -> NetworkPosteriors:
        """Return the posteriors of recordings, which are concatenated in ``log_emission``.

        log_emission : [shape=(T, G)], finite or -inf; the posteriors have the same precision
        columns      : [shape=(S,)], the density of the state at each place
        frames       : [shape=(U,)], number of frames of each recording
        Cost: as ``product_posteriors``.
        """
        return self.product_posteriors([log_emission], [columns], frames)

    def product_posteriors(
        self, log_emissions: Sequence[NDArray[np.floating[Any]]], columns: Sequence[Index], frames: Index
    ) -> NetworkPosteriors:
        """Return the posteriors of recordings whose densities are products of one factor from each chain.

        log_emissions : one or more [shape=(T, G_c)], all of one precision, finite or -inf; the log density of the state
            at place s is the sum over chains of ``log_emissions[c][:, columns[c][s]]``
        columns       : of each chain [shape=(S,)]
        frames        : [shape=(U,)], number of frames of each recording
        What is computed is ``log_forward_backward``: compiled, in the precision of ``log_emissions``; for recordings of
        which that would lose what counts, in double precision, and at last in logarithms by NumPy.
        Cost: O(T·E), and exponentials of the chains' densities; in double precision twice, in logarithms some fifty
        times as slow.
        """
        precision = log_emissions[0].dtype
        if numba_works():
            expected = self._compiled(log_emissions, columns, frames)
        else:
            posterior = np.zeros((len(log_emissions[0]), len(columns[0])), precision)
            expected = NetworkPosteriors(posterior, np.zeros(len(self.arc_log)), np.full(len(frames), -np.inf))
        edges = np.append(0, np.cumsum(frames))
        for u in np.flatnonzero(np.isneginf(expected.log_likelihood)):
            of_recording = slice(edges[u], edges[u + 1])
            logs = [log[of_recording].astype(np.float64) for log in log_emissions]
            again = None
            if numba_works() and precision == np.float32:
                again = self._compiled(logs, columns, frames[u : u + 1])
            if again is None or np.isneginf(again.log_likelihood[0]):
                again = self._in_logs(_joint(logs, columns))
            expected.posterior[of_recording], expected.log_likelihood[u] = again.posterior, again.log_likelihood[0]
            expected.counts[:] += again.counts
        return expected

    def _compiled(
        self, log_emissions: Sequence[NDArray[np.floating[Any]]], columns: Sequence[Index], frames: Index
    ) -> NetworkPosteriors:
        """Return the posteriors of recordings by the compiled kernel, in the precision of ``log_emissions``.

        A recording for which that is not enough has a log likelihood of -inf, no counts, and no posteriors.
        """
        from lipmotion.kernels.compiled import network

        root, best = _products(log_emissions, columns)
        layout, edges = self.layout, np.append(0, np.cumsum(frames))
        (initial, first), (final, last) = (
            _probabilities(log[layout.order]) for log in (self.log_initial, self.log_final)
        )
        run_counts, leaving, entering, scales, ends = network.forward_backward(
            root, edges, initial, final, self.chunks.runs, self.chunks.weight.astype(root.dtype),
            layout.blocks.astype(np.uintp), layout.block_sources.astype(np.uintp),
            self.weights.blocks.astype(root.dtype), self.transposed.astype(root.dtype), *LIMITS[root.dtype],
        )  # fmt: skip
        counts = np.zeros(len(self.arc_log))
        counts[layout.run_arcs] = run_counts[self.chunks.arcs] * self.weights.runs
        _count_blocks(counts, layout, self.weights, leaving, entering)
        with np.errstate(divide="ignore"):
            log_likelihood = np.add.reduceat(np.log(scales) + best, edges[:-1]) + (np.log(ends) + first + last)
        return NetworkPosteriors(root, counts, log_likelihood + (frames - 1) * self.best_arc)

    def _in_logs(self, log_density: Array) -> NetworkPosteriors:
        """Return the posteriors of one recording by NumPy, in logarithms, without underflow.

        log_density : [shape=(T, S)], by place
        """
        arc_to = np.repeat(np.arange(len(self.arc_start)), np.diff(self.arc_start, append=len(self.arc_from)))
        log_emission = log_density[:, self.layout.place]
        log_posterior, counts, log_likelihood = log_forward_backward(
            self.log_initial, log_emission, self.arc_from, arc_to, self.arc_log, self.log_final
        )
        return NetworkPosteriors(np.exp(log_posterior)[:, self.layout.order], counts, np.array([log_likelihood]))


def _roots(log_density: NDArray[np.floating[Any]]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the eighth roots of densities relative to the best of each frame, and the logarithm of the best.

    Roots of densities above e⁻⁶⁴⁰ are normal numbers in single precision; lower densities are raised to that.
    """
    best = log_density.max(axis=1)
    best[~np.isfinite(best)] = 0
    root = log_density - best[:, None]
    root *= root.dtype.type(1 / 8)
    return np.exp(np.maximum(root, LOWEST_ROOT, out=root), out=root), best


def _products(
    log_densities: Sequence[NDArray[np.floating[Any]]], columns: Sequence[Index]
) -> tuple[NDArray[Any], Array]:
    """Return the roots of joint densities, by place, relative to each frame's best, and the logarithm of the best.

    Densities lower than the best by some 560 nats may be 0; where all are, the logarithm is -inf.
    """
    from lipmotion.kernels.compiled import network

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
        network.products(np.hstack(roots), shifted, joint[of_recording], best[of_recording])
        far = start + np.flatnonzero(best[of_recording] < LEAST_JOINT)
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


def _weighted(layout: ArcLayout, arc_log: Array) -> tuple[float, ArcWeights, Array, Chunks]:
    """Return the logarithm of the greatest probability of an arc, and the probabilities relative to that, in all forms
    that the kernels take.

    arc_log : logarithms of probabilities [shape=(E,)]
    """
    relative, best = _probabilities(arc_log)
    weights = arc_weights(layout, relative, 0.0)
    return best, weights, _transposed(layout, weights), Chunks.of(layout, weights)


def _transposed(layout: ArcLayout, weights: ArcWeights) -> Array:
    """Return the weights of all blocks, targets as rows, sources as columns, padded."""
    transposed = [np.empty((0, -(-layout.blocks[:, 3].max(initial=0) // PADDED) * PADDED))]
    for _, targets, first, sources in layout.blocks:
        matrix = np.zeros((targets, transposed[0].shape[1]))
        matrix[:, :sources] = weights.blocks[first : first + sources, :targets].T
        transposed.append(matrix)
    return np.concatenate(transposed)


def _count_blocks(counts: Array, layout: ArcLayout, weights: ArcWeights, leaving: Array, entering: Array) -> None:
    """Fill in the expected counts of the arcs of all blocks: one matrix product each."""
    start = 0
    for _, targets, first, sources in layout.blocks:
        of_recording = slice(first, first + sources), slice(0, targets)
        pairs = leaving[:, of_recording[0]].T @ entering[:, start : start + targets]
        counts[layout.block_arcs[of_recording]] = pairs * weights.blocks[of_recording]
        start += targets
