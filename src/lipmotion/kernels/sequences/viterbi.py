"""The best state path through a network of states."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.choice import compiled_pays
from lipmotion.kernels.sequences.arcs import ArcLayout, ArcWeights, NetworkArrays, arc_layout, arc_weights

Index = NDArray[np.intp]
Scores = NDArray[np.float32]
LogEmission = Callable[[int, int], NDArray[np.float32]]
"""Function of a first frame and an end: returns the log densities of these frames [shape=(end - first, G)]."""
BLOCK, BLOCK_SCORES = 2048, 1 << 22
"""Frames whose scores are in memory at a time, and scores, whichever are more; earlier scores are computed again from
checkpoints."""
FRAME_S, ARC_S = 10e-6, 15e-9
"""Time that NumPy takes for a frame, and for every arc in it (docs/results/kernels.md)."""
LEAST_RUN_ARCS = 20.0
"""Networks whose runs of arcs are shorter on average are searched arc by arc: a run costs as much as 30 single arcs."""


def best_path(
    log_emission: LogEmission,
    count: int,
    network: NetworkArrays,
    beam: float | None = None,
    layout: Callable[[], ArcLayout] | None = None,
) -> tuple[NDArray[np.intp], float]:
    """Return the most probable path and its log probability (-inf: no path).

    log_emission : of G emission densities; called for at most the frames of a block and one, and for each frame at most
                   twice, with the same result
    count        : frames, T
    network      : logarithms in single precision
    beam         : states with a score lower than the best of the frame by more than this are dropped: that is faster,
                   but may miss the best path, or every path; None: exact
    layout       : returns the layout of the arcs, where it is kept from search to search
    Returns the states of the path [shape=(T,)], and its score. Scores are relative to the best of their frame and in
    single precision: no path is lost, but one may be preferred to another that is better by less than their rounding.
    Cost: O(T·E) time, O((T / B + B)·(S + G)) memory, with B frames in a block.
    """
    emission, widest = network.emission, np.inf if beam is None else beam
    if compiled_pays(count * (FRAME_S + ARC_S * len(network.arc_from))):
        search = _compiled_search(
            network, widest, layout() if layout else arc_layout(network.arc_from, network.arc_start)
        )
    else:
        search = _plain_search(network, widest)
    block = max(BLOCK, BLOCK_SCORES // len(emission))
    starts = range(0, count, block)
    first = (network.log_initial + log_emission(0, 1)[0, emission])[None]
    checkpoints, score = [first[0, search.order]], 0.0
    for start in starts[1:]:
        delta, shift = search.scores(checkpoints[-1], log_emission(start - block, start + 1))
        checkpoints.append(delta[-1].copy())  # a view would keep the whole block
        score += shift
    path = np.empty(count, np.intp)
    state = -1
    for start, checkpoint in zip(reversed(starts), reversed(checkpoints), strict=True):
        stop = min(start + block + 1, count)
        delta, shift = search.scores(checkpoint, log_emission(start, stop))
        if state < 0:
            last = delta[-1, search.place] + network.log_final
            state = int(last.argmax())
            score += shift + float(last[state])
            path[-1] = state
        search.trace(path[start : stop - 1], delta, state)
        state = int(path[start])
    return path, score


@dataclass(frozen=True, eq=False)
class PathSearch:
    """The search for the best path through a network. Rows of scores are by place.

    order, place    : of the layout, or without one those of the states' own order
    layout, weights : for the compiled form; None: NumPy computes, or arc by arc
    by_arcs         : whether the compiled form goes arc by arc
    """

    network: NetworkArrays
    beam: float
    order: Index
    place: Index
    layout: ArcLayout | None = None
    weights: ArcWeights | None = None
    by_arcs: bool = False

    def scores(self, first: Scores, log_emission: Scores) -> tuple[Scores, float]:
        """Return the scores of the best path to every state, relative to each frame's best, and the sum of these best.

        first        : the scores in the first frame [shape=(S,)]
        log_emission : [shape=(T, G)]
        """
        delta = np.empty((len(log_emission), len(self.network.emission)), np.float32)
        delta[0] = first
        if not self.by_arcs and (self.layout is None or self.weights is None):
            return delta, self._fill(delta, log_emission)
        from lipmotion.kernels.compiled import viterbi

        columns = self.network.emission[self.order].astype(np.uintp)  # indices that may be negative are not vectorised
        log_emission = np.ascontiguousarray(log_emission, np.float32)
        if self.layout is None or self.weights is None:
            sources, stops = self.network.arc_from.astype(np.uintp), self._arc_stops
            arc_log = np.asarray(self.network.arc_log, np.float32)
            beam = np.float32(-self.beam)
            return delta, float(viterbi.scores_by_arcs(delta, log_emission, columns, sources, arc_log, stops, beam))
        _, _, runs, _, blocks, block_sources, _ = self.layout
        arcs = (runs, self.weights.runs, blocks, block_sources, self.weights.blocks)
        return delta, float(viterbi.scores(delta, log_emission, columns, *arcs, np.float32(-self.beam)))

    @property
    def _arc_stops(self) -> Index:
        """The end of every state's arcs."""
        return np.append(self.network.arc_start[1:], len(self.network.arc_from))

    def _fill(self, delta: Scores, log_emission: Scores) -> float:
        """Compute all rows but the first, by NumPy; return the sum of the frames' best scores."""
        emission, arc_from, arc_log, arc_start, _, _ = self.network
        arrivals = np.empty(len(arc_from), np.float32)
        shift = 0.0
        for frame in range(1, len(delta)):
            np.take(delta[frame - 1], arc_from, out=arrivals)
            arrivals += arc_log
            row = np.maximum.reduceat(arrivals, arc_start, out=delta[frame])
            row += log_emission[frame, emission]
            best = row.max()
            if best > -np.inf:
                row -= best
                row[row < np.float32(-self.beam)] = -np.inf
                shift += float(best)
        return shift

    def trace(self, path: Index, delta: Scores, state: int) -> None:
        """Fill in the path before ``state`` in the last frame of ``delta``: without back-pointers, from the scores."""
        _, arc_from, arc_log, arc_start, _, _ = self.network
        if self.layout is not None or self.by_arcs:
            from lipmotion.kernels.compiled import viterbi

            viterbi.trace(path, delta, state, self.place, arc_from, arc_log, arc_start)
            return
        stops = self._arc_stops
        for frame in range(len(path) - 1, -1, -1):
            arcs = slice(arc_start[state], stops[state])
            sources = arc_from[arcs]
            state = int(sources[(delta[frame, sources] + arc_log[arcs]).argmax()])
            path[frame] = state


def path_search(network: NetworkArrays, compiled: bool) -> PathSearch:
    """Return the exact search through a network, in its compiled form or in that of NumPy."""
    if not compiled:
        return _plain_search(network, np.inf)
    return _compiled_search(network, np.inf, arc_layout(network.arc_from, network.arc_start))


def _plain_search(network: NetworkArrays, beam: float) -> PathSearch:
    states = np.arange(len(network.emission))
    return PathSearch(network, beam, order=states, place=states)


def _compiled_search(network: NetworkArrays, beam: float, layout: ArcLayout) -> PathSearch:
    if len(layout.run_arcs) < LEAST_RUN_ARCS * len(layout.runs):
        return replace(_plain_search(network, beam), by_arcs=True)
    return PathSearch(network, beam, layout.order, layout.place, layout, arc_weights(layout, network.arc_log, -np.inf))
