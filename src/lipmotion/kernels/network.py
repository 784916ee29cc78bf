"""State posteriors and expected arc counts of networks of states, by forward–backward."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.arcs import PADDED, ArcLayout, ArcWeights, arc_layout, arc_weights
from lipmotion.kernels.choice import numba_works

Index = NDArray[np.intp]
Array = NDArray[np.float64]
CHUNK = 16
"""Runs of arcs are padded to multiples of this."""
FRAMES_AT_ONCE = 256
"""Frames whose roots are taken at once: they stay in the cache."""
LOWEST_ROOT = -80.0
"""Least logarithm of a density's eighth root: exp of less is denormal in single precision, which is slow."""


class NetworkPosteriors(NamedTuple):
    """Posteriors of recordings in a network.

    posterior      : [shape=(T, S)], of the states by place (``kernels.arcs``), all recordings concatenated
    counts         : [shape=(E,)], expected number of times that each arc is followed, over all recordings
    log_likelihood : [shape=(U,)], of each recording; -inf where there is no path: then its posteriors are 0
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

    arc_from, arc_log, arc_start, log_initial, log_final : as in ``kernels.arcs.NetworkArrays``
    layout     : of the arcs
    weights    : the probabilities of arcs, in the layout
    transposed : those of blocks, targets as rows, sources as columns
    chunks     : those of runs
    """

    arc_from: Index
    arc_log: Array
    arc_start: Index
    log_initial: Array
    log_final: Array
    layout: ArcLayout
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
        """Return a network prepared for forward–backward; parameters as in ``kernels.arcs.NetworkArrays``."""
        layout = arc_layout(arc_from, arc_start)
        weights, transposed, chunks = _weighted(layout, arc_log)
        arc_log, log_initial, log_final = (log.astype(np.float64) for log in (arc_log, log_initial, log_final))
        return cls(arc_from, arc_log, arc_start, log_initial, log_final, layout, weights, transposed, chunks)

    def with_arcs(
        self, arc_log: NDArray[np.floating[Any]], log_initial: NDArray[np.floating[Any]]
    ) -> ForwardBackwardNetwork:
        """Return the network with other probabilities of arcs [shape=(E,)] and of beginnings [shape=(S,)]."""
        weights, transposed, chunks = _weighted(self.layout, arc_log)
        changed = self._replace(weights=weights, transposed=transposed, chunks=chunks)
        return changed._replace(arc_log=arc_log.astype(np.float64), log_initial=log_initial.astype(np.float64))

    def posteriors(self, log_emission: NDArray[np.floating[Any]], columns: Index, frames: Index) -> NetworkPosteriors:
        """Return the posteriors of recordings, which are concatenated in ``log_emission``.

        log_emission : [shape=(T, G)], finite or -inf; the posteriors have the same precision
        columns      : [shape=(S,)], the density of the state at each place
        frames       : [shape=(U,)], number of frames of each recording
        Source: the standard recursions.  Compiled, paths 320 nats below a frame's best are left out, unless none is
        left then, and posteriors under 1e-12 are 0.
        Cost: O(T·E); in NumPy some fifty times slower.
        """
        if not numba_works():
            return self._completed([log_emission], [columns], frames, None)
        root, best = _roots(log_emission)
        if not np.array_equal(columns, np.arange(root.shape[1])):
            root = root.take(columns, axis=1)
        return self._completed([log_emission], [columns], frames, self._compiled(root, best, frames))

    def product_posteriors(
        self, log_emissions: Sequence[NDArray[np.floating[Any]]], columns: Sequence[Index], frames: Index
    ) -> NetworkPosteriors:
        """Return the posteriors of recordings whose densities are products of one factor from each chain.

        log_emissions : one or more [shape=(T, G_c)], all of one precision; the log density of the state at place s is
            the sum over chains of ``log_emissions[c][:, columns[c][s]]``
        columns       : of each chain [shape=(S,)]
        frames        : [shape=(U,)], number of frames of each recording
        Cost: as ``posteriors``, but exponentials are taken of the chains' densities only.
        """
        if not numba_works():
            return self._completed(log_emissions, columns, frames, None)
        single = log_emissions[0].dtype == np.float32
        expected = self._compiled(*_products(log_emissions, columns), frames, single)
        edges = np.append(0, np.cumsum(frames))
        for u in np.flatnonzero(np.isneginf(expected.log_likelihood)) if single else []:
            of_recording = slice(edges[u], edges[u + 1])
            again = self._compiled(*_products([log[of_recording] for log in log_emissions], columns), frames[u : u + 1])
            expected.posterior[of_recording], expected.log_likelihood[u] = again.posterior, again.log_likelihood[0]
            expected.counts[:] += again.counts
        return self._completed(log_emissions, columns, frames, expected)

    def _completed(
        self,
        log_emissions: Sequence[NDArray[np.floating[Any]]],
        columns: Sequence[Index],
        frames: Index,
        expected: NetworkPosteriors | None,
    ) -> NetworkPosteriors:
        """Return the posteriors; those of recordings without a path in ``expected`` are computed in logarithms.

        expected : the compiled result; None: there is none, all are computed in logarithms
        """
        if expected is None:
            posterior = np.zeros((len(log_emissions[0]), len(columns[0])), log_emissions[0].dtype)
            expected = NetworkPosteriors(posterior, np.zeros(len(self.arc_log)), np.full(len(frames), -np.inf))
        edges = np.append(0, np.cumsum(frames))
        for u in np.flatnonzero(np.isneginf(expected.log_likelihood)):
            of_recording = slice(edges[u], edges[u + 1])
            log_emission = sum(
                log[of_recording, column[self.layout.place]].astype(np.float64)
                for log, column in zip(log_emissions, columns, strict=True)
            )
            posterior, counts, expected.log_likelihood[u] = self._in_logs(np.asarray(log_emission))
            expected.posterior[of_recording] = posterior[:, self.layout.order]
            expected.counts[:] += counts
        return expected

    def _compiled(
        self, root: NDArray[Any], best: NDArray[Any], frames: Index, single: bool = False
    ) -> NetworkPosteriors:
        """Return the posteriors of recordings by the compiled kernels; without a path in their range, 0 and -inf.

        root : [shape=(T, S)], by place, the eighth roots of densities relative to ``best``; overwritten by posteriors
        best : [shape=(T,)], logarithms
        single : whether probabilities may be in single precision; a recording for which that is not enough gets 0, -inf
        """
        from lipmotion.kernels.compiled import network

        run_weight: NDArray[Any] = self.chunks.weight.astype(np.float32 if single else np.float64)
        kernel = network.forward_backward_single if single else network.forward_backward
        layout, edges = self.layout, np.append(0, np.cumsum(frames))
        (initial, first), (final, last) = (
            _probabilities(log[layout.order]) for log in (self.log_initial, self.log_final)
        )
        run_counts, leaving, entering, scales, ends = kernel(
            root, edges, initial, final, self.chunks.runs, run_weight,
            layout.blocks.astype(np.uintp), layout.block_sources.astype(np.uintp),
            self.weights.blocks.astype(root.dtype), self.transposed.astype(root.dtype),
        )  # fmt: skip
        counts = np.zeros(len(self.arc_log))
        counts[layout.run_arcs] = run_counts[self.chunks.arcs] * self.weights.runs
        _count_blocks(counts, layout, self.weights, leaving, entering)
        with np.errstate(divide="ignore"):
            log_likelihood = np.add.reduceat(np.log(scales) + best, edges[:-1]) + (np.log(ends) + first + last)
        return NetworkPosteriors(root, counts, log_likelihood)

    def _in_logs(self, log_emission: Array) -> tuple[Array, Array, float]:
        """Return posteriors, counts and log likelihood of one recording by NumPy, in logarithms, without underflow.

        log_emission : [shape=(T, S)], of the states in their own order
        """
        (T, states), arc_from = log_emission.shape, self.arc_from
        arc_to = np.repeat(np.arange(states), np.diff(self.arc_start, append=len(arc_from)))
        by_source = np.argsort(arc_from, kind="stable")
        sources, source_start = np.unique(arc_from[by_source], return_index=True)
        alpha, beta, counts = np.empty((T, states)), np.full((T, states), -np.inf), np.zeros(len(arc_from))
        alpha[0] = self.log_initial + log_emission[0]
        for t in range(1, T):
            alpha[t] = np.logaddexp.reduceat(alpha[t - 1, arc_from] + self.arc_log, self.arc_start) + log_emission[t]
        log_likelihood = float(np.logaddexp.reduce(alpha[-1] + self.log_final))
        if not np.isfinite(log_likelihood):
            return np.zeros((T, states)), counts, -np.inf
        beta[-1] = self.log_final
        for t in range(T - 2, -1, -1):
            onward = self.arc_log + (log_emission[t + 1] + beta[t + 1])[arc_to]
            beta[t, sources] = np.logaddexp.reduceat(onward[by_source], source_start)
            counts += np.exp(alpha[t, arc_from] + onward - log_likelihood)
        return np.exp(alpha + beta - log_likelihood), counts, log_likelihood


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
    """Return the roots of joint densities, by place, relative to each frame's best, and the logarithm of the best."""
    from lipmotion.kernels.compiled import network

    firsts = np.cumsum([0, *(log.shape[1] for log in log_densities[:-1])])
    shifted = (np.stack(columns) + firsts[:, None]).astype(np.uint32)
    frames = len(log_densities[0])
    joint, best = np.empty((frames, shifted.shape[1]), log_densities[0].dtype), np.empty(frames)
    for start in range(0, frames, FRAMES_AT_ONCE):
        of_recording = slice(start, start + FRAMES_AT_ONCE)
        roots, bests = zip(*(_roots(log[of_recording]) for log in log_densities), strict=True)
        network.products(np.hstack(roots), shifted, joint[of_recording], best[of_recording])
        with np.errstate(divide="ignore"):
            best[of_recording] = 8 * np.log(best[of_recording]) + np.sum(bests, axis=0, dtype=np.float64)
    return joint, best


def _probabilities(log: Array) -> tuple[Array, float]:
    """Return probabilities relative to the greatest, and the logarithm of the greatest."""
    best = float(log.max())
    best = best if np.isfinite(best) else 0.0
    return np.exp(log - best), best


def _weighted(layout: ArcLayout, arc_log: NDArray[np.floating[Any]]) -> tuple[ArcWeights, Array, Chunks]:
    """Return the probabilities of arcs, given as logarithms [shape=(E,)], in all forms that the kernels take."""
    weights = arc_weights(layout, np.exp(arc_log.astype(np.float64)), 0.0)
    return weights, _transposed(layout, weights), Chunks.of(layout, weights)


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
