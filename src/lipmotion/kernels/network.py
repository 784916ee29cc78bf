"""State posteriors and expected arc counts of networks, by forward–backward."""

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
"""Arcs of a run are followed so many at once."""
FRAMES_AT_ONCE = 256
"""Of which roots are taken: they stay near the processor."""
LOWEST_ROOT = -80.0
"""Of the logarithm of a density's eighth root: exp of less is denormal in single precision, and slow."""


def network_posteriors(
    log_emission: NDArray[np.floating[Any]],
    emission: Index,
    arc_from: Index,
    arc_log: NDArray[np.floating[Any]],
    arc_start: Index,
    log_initial: NDArray[np.floating[Any]],
    log_final: NDArray[np.floating[Any]],
) -> tuple[Array, Array, float]:
    """Return the probability of every state in every frame, how often each arc is expected to be followed, and the
    log likelihood.

    log_emission : [shape=(T, G)], finite or -inf
    emission     : [shape=(S,)], the density of each state
    arc_from     : [shape=(E,)], the source states of all arcs, sorted by target
    arc_log      : [shape=(E,)], log probabilities
    arc_start    : [shape=(S,)], where each target's arcs begin; every state has at least one
    log_initial, log_final : [shape=(S,)], of beginning and ending in each state
    Returns posterior [shape=(T, S)], counts [shape=(E,)], log likelihood; where there is no path 0, 0 and -inf.
    Source: the standard recursions.  Compiled, paths 320 nats under a frame's best are left out, unless none is left
    then; posteriors under 1e-12 are 0; and what is given in single precision comes back as precise.
    Cost: O(T·E), by NumPy some fifty times slower.
    """
    expectation = ForwardBackwardNetwork.of(arc_from, arc_log, arc_start, log_initial, log_final)
    order, place = expectation.layout.order, expectation.layout.place
    found = expectation.over(log_emission, emission[order], np.array([len(log_emission)]))
    return found.posterior[:, place], found.counts, float(found.log_likelihood[0])


class NetworkPosteriors(NamedTuple):
    """What recordings say about a network.

    posterior      : [shape=(T, S)], by place (``kernels.arcs``), of all recordings one after the other
    counts         : [shape=(E,)], how often each arc is expected to be followed, over all recordings
    log_likelihood : [shape=(U,)], of each; -inf where there is no path, and then it adds nothing to the other two
    """

    posterior: NDArray[Any]
    counts: Array
    log_likelihood: Array


class Chunks(NamedTuple):
    """Runs of arcs, each padded to whole chunks.

    runs   : [shape=(R, 4)], first target's place, first source's place, chunks, position in ``weight``
    weight : [shape=(M,)], 0 for what pads
    arcs   : [shape=(N,)], the positions of arcs of runs
    """

    runs: NDArray[np.uintp]
    weight: Array
    arcs: Index

    @classmethod
    def of(cls, layout: ArcLayout, weights: ArcWeights) -> Chunks:
        """Return the runs of a layout."""
        runs = layout.runs.copy()
        runs[:, 2] = -(-runs[:, 2] // CHUNK) * CHUNK
        runs[:, 3] = np.cumsum(runs[:, 2]) - runs[:, 2]
        weight = np.zeros(runs[:, 2].sum())
        arcs = np.arange(len(weights.runs)) + np.repeat(runs[:, 3] - layout.runs[:, 3], layout.runs[:, 2])
        weight[arcs] = weights.runs
        return cls(runs.astype(np.uintp), weight, arcs)


class ForwardBackwardNetwork(NamedTuple):
    """A network ready for forward–backward; arrays as in ``network_posteriors``.

    layout  : of the arcs
    weights : their probabilities, laid out
    turned  : those of blocks, targets as rows, sources as columns
    chunks  : those of runs
    """

    arc_from: Index
    arc_log: Array
    arc_start: Index
    log_initial: Array
    log_final: Array
    layout: ArcLayout
    weights: ArcWeights
    turned: Array
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
        """Return a network ready."""
        layout = arc_layout(arc_from, arc_start)
        weights, turned, chunks = _weighted(layout, arc_log)
        arc_log, log_initial, log_final = (log.astype(np.float64) for log in (arc_log, log_initial, log_final))
        return cls(arc_from, arc_log, arc_start, log_initial, log_final, layout, weights, turned, chunks)

    def with_arcs(
        self, arc_log: NDArray[np.floating[Any]], log_initial: NDArray[np.floating[Any]]
    ) -> ForwardBackwardNetwork:
        """Return the network with other probabilities [shapes=(E,), (S,)]; nothing is laid out anew."""
        weights, turned, chunks = _weighted(self.layout, arc_log)
        changed = self._replace(weights=weights, turned=turned, chunks=chunks)
        return changed._replace(arc_log=arc_log.astype(np.float64), log_initial=log_initial.astype(np.float64))

    def over(self, log_emission: NDArray[np.floating[Any]], columns: Index, frames: Index) -> NetworkPosteriors:
        """Return what recordings say, one after the other in ``log_emission``.

        log_emission : [shape=(T, G)]; the result's posteriors are as precise as these
        columns      : [shape=(S,)], the density of the state at each place
        frames       : [shape=(U,)], of each recording
        """
        if not numba_works():
            return self._over([log_emission], [columns], frames, None)
        root, best = _roots(log_emission)
        if not np.array_equal(columns, np.arange(root.shape[1])):
            root = root.take(columns, axis=1)
        return self._over([log_emission], [columns], frames, self._compiled(root, best, frames))

    def over_chains(
        self, log_emissions: Sequence[NDArray[np.floating[Any]]], columns: Sequence[Index], frames: Index
    ) -> NetworkPosteriors:
        """Return what recordings say whose densities are products, one factor from each of some chains.

        log_emissions : one or more [shape=(T, G_c)], all as precise; the log density of the state at place s is the
            sum over chains of ``log_emissions[c][:, columns[c][s]]``
        columns       : of each chain [shape=(S,)]
        frames        : [shape=(U,)], of each recording
        Cost: as ``over``, but exponentials are taken of the chains' densities only.
        """
        if not numba_works():
            return self._over(log_emissions, columns, frames, None)
        single = log_emissions[0].dtype == np.float32
        expected = self._compiled(*_products(log_emissions, columns), frames, single)
        edges = np.append(0, np.cumsum(frames))
        for u in np.flatnonzero(np.isneginf(expected.log_likelihood)) if single else []:
            mine = slice(edges[u], edges[u + 1])
            again = self._compiled(*_products([log[mine] for log in log_emissions], columns), frames[u : u + 1])
            expected.posterior[mine], expected.log_likelihood[u] = again.posterior, again.log_likelihood[0]
            expected.counts[:] += again.counts
        return self._over(log_emissions, columns, frames, expected)

    def _over(
        self,
        log_emissions: Sequence[NDArray[np.floating[Any]]],
        columns: Sequence[Index],
        frames: Index,
        expected: NetworkPosteriors | None,
    ) -> NetworkPosteriors:
        """Return what was found, what has no path yet in logarithms."""
        if expected is None:
            posterior = np.zeros((len(log_emissions[0]), len(columns[0])), log_emissions[0].dtype)
            expected = NetworkPosteriors(posterior, np.zeros(len(self.arc_log)), np.full(len(frames), -np.inf))
        edges = np.append(0, np.cumsum(frames))
        for u in np.flatnonzero(np.isneginf(expected.log_likelihood)):
            mine = slice(edges[u], edges[u + 1])
            log_emission = sum(
                log[mine, column[self.layout.place]].astype(np.float64)
                for log, column in zip(log_emissions, columns, strict=True)
            )
            posterior, counts, expected.log_likelihood[u] = self._in_logs(np.asarray(log_emission))
            expected.posterior[mine] = posterior[:, self.layout.order]
            expected.counts[:] += counts
        return expected

    def _compiled(
        self, root: NDArray[Any], best: NDArray[Any], frames: Index, single: bool = False
    ) -> NetworkPosteriors:
        """Return what recordings say, where there are paths within reach.

        root : [shape=(T, S)], by place, the eighth roots of densities relative to ``best``; becomes the posteriors
        best : [shape=(T,)], logarithms
        single : whether states may be in single precision (0 and -inf for a recording for which that is not enough)
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
            self.weights.blocks.astype(root.dtype), self.turned.astype(root.dtype),
        )  # fmt: skip
        counts = np.zeros(len(self.arc_log))
        counts[layout.run_arcs] = run_counts[self.chunks.arcs] * self.weights.runs
        _count_blocks(counts, layout, self.weights, leaving, entering)
        with np.errstate(divide="ignore"):
            log_likelihood = np.add.reduceat(np.log(scales) + best, edges[:-1]) + (np.log(ends) + first + last)
        return NetworkPosteriors(root, counts, log_likelihood)

    def _in_logs(self, log_emission: Array) -> tuple[Array, Array, float]:
        """Return posteriors, counts and log likelihood of one recording by NumPy, in logarithms: none is too small.

        log_emission : [shape=(T, S)], of the states as they are
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
    """Return the eighth roots of densities relative to the best of each frame, and its logarithm.

    Those of all densities above e⁻⁶⁴⁰ are single-precision numbers; others become that.
    """
    best = log_density.max(axis=1)
    best[~np.isfinite(best)] = 0
    root = log_density - best[:, None]
    root *= root.dtype.type(1 / 8)
    return np.exp(np.maximum(root, LOWEST_ROOT, out=root), out=root), best


def _products(
    log_densities: Sequence[NDArray[np.floating[Any]]], columns: Sequence[Index]
) -> tuple[NDArray[Any], Array]:
    """Return the roots of joint densities, by place, relative to the best of each frame, and its logarithm."""
    from lipmotion.kernels.compiled import network

    firsts = np.cumsum([0, *(log.shape[1] for log in log_densities[:-1])])
    shifted = (np.stack(columns) + firsts[:, None]).astype(np.uint32)
    frames = len(log_densities[0])
    joint, best = np.empty((frames, shifted.shape[1]), log_densities[0].dtype), np.empty(frames)
    for start in range(0, frames, FRAMES_AT_ONCE):
        mine = slice(start, start + FRAMES_AT_ONCE)
        roots, bests = zip(*(_roots(log[mine]) for log in log_densities), strict=True)
        network.products(np.hstack(roots), shifted, joint[mine], best[mine])
        with np.errstate(divide="ignore"):
            best[mine] = 8 * np.log(best[mine]) + np.sum(bests, axis=0, dtype=np.float64)
    return joint, best


def _probabilities(log: Array) -> tuple[Array, float]:
    """Return probabilities relative to the greatest, and its logarithm."""
    best = float(log.max())
    best = best if np.isfinite(best) else 0.0
    return np.exp(log - best), best


def _weighted(layout: ArcLayout, arc_log: NDArray[np.floating[Any]]) -> tuple[ArcWeights, Array, Chunks]:
    """Return the probabilities of arcs, given by their logarithms [shape=(E,)], in all forms that kernels take."""
    weights = arc_weights(layout, np.exp(arc_log.astype(np.float64)), 0.0)
    return weights, _turned(layout, weights), Chunks.of(layout, weights)


def _turned(layout: ArcLayout, weights: ArcWeights) -> Array:
    """Return the weights of all blocks, targets as rows, sources as columns, padded."""
    turned = [np.empty((0, -(-layout.blocks[:, 3].max(initial=0) // PADDED) * PADDED))]
    for _, targets, first, sources in layout.blocks:
        matrix = np.zeros((targets, turned[0].shape[1]))
        matrix[:, :sources] = weights.blocks[first : first + sources, :targets].T
        turned.append(matrix)
    return np.concatenate(turned)


def _count_blocks(counts: Array, layout: ArcLayout, weights: ArcWeights, leaving: Array, entering: Array) -> None:
    """Fill in the expected counts of the arcs of all blocks: one matrix product each."""
    start = 0
    for _, targets, first, sources in layout.blocks:
        mine = slice(first, first + sources), slice(0, targets)
        pairs = leaving[:, mine[0]].T @ entering[:, start : start + targets]
        counts[layout.block_arcs[mine]] = pairs * weights.blocks[mine]
        start += targets
