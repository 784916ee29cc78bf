"""The best state path through a network of states."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.arcs import ArcLayout, ArcWeights, arc_layout, arc_weights
from lipmotion.kernels.choice import compiled_pays

Index = NDArray[np.intp]
Scores = NDArray[np.float32]
LogEmission = Callable[[int, int], NDArray[np.float32]]
"""Gives the log densities of the frames from one up to another [shape=(frames, G)], the same at every call."""
BLOCK = 2048
"""Frames whose scores are kept at a time; earlier ones are computed again from checkpoints."""
FRAME_S, ARC_S = 10e-6, 15e-9
"""What NumPy takes for a frame, and for every arc in it (docs/results/kernels.md)."""


def best_path(
    log_emission: LogEmission,
    count: int,
    emission: NDArray[np.intp],
    arc_from: NDArray[np.intp],
    arc_log: NDArray[np.float32],
    arc_start: NDArray[np.intp],
    log_initial: NDArray[np.float32],
    log_final: NDArray[np.float32],
    beam: float | None = None,
    layout: Callable[[], ArcLayout] | None = None,
) -> tuple[NDArray[np.intp], float]:
    """Return the most probable path and its log probability (-inf: no path).

    log_emission : of G emission densities; asked for at most ``BLOCK`` + 1 frames at a time, for each at most twice
    count        : frames, T
    emission     : [shape=(S,)], the density of each of S states
    arc_from     : [shape=(E,)], the source states of all arcs, sorted by target
    arc_log      : [shape=(E,)]
    arc_start    : [shape=(S,)], where each target's arcs begin; every state has at least one
    log_initial, log_final : [shape=(S,)]
    beam         : states whose score falls more than this under the frame's best are dropped: faster, and no longer
                   sure to find the best path, or one at all; None: exact
    layout       : gives that of the arcs (``kernels.arcs``), where it is kept from search to search
    Returns path [shape=(T,)], score.
    Cost: O(T·E) time, O((T / BLOCK + BLOCK)·(S + G)) memory.
    """
    arcs = (emission, arc_from, arc_log, arc_start, np.inf if beam is None else beam)
    if compiled_pays(count * (FRAME_S + ARC_S * len(arc_from))):
        search = _laid_out(arcs, layout() if layout else arc_layout(arc_from, arc_start))
    else:
        search = _Search(*arcs, order=np.arange(len(emission)), place=np.arange(len(emission)))
    starts = range(0, count, BLOCK)
    first = (log_initial + log_emission(0, 1)[0, emission])[None]
    checkpoints, score = [first[0, search.order]], 0.0
    for start in starts[1:]:
        delta, shift = search.scores(checkpoints[-1], log_emission(start - BLOCK, start + 1))
        checkpoints.append(delta[-1].copy())  # a view would keep the whole block
        score += shift
    path = np.empty(count, np.intp)
    state = -1
    for start, checkpoint in zip(reversed(starts), reversed(checkpoints), strict=True):
        stop = min(start + BLOCK + 1, count)
        delta, shift = search.scores(checkpoint, log_emission(start, stop))
        if state < 0:
            last = delta[-1, search.place] + log_final
            state = int(last.argmax())
            score += shift + float(last[state])
            path[-1] = state
        search.trace(path[start : stop - 1], delta, state)
        state = int(path[start])
    return path, score


@dataclass(frozen=True, eq=False)
class _Search:
    """A network, and how its scores are computed; rows of scores are by place.

    order, place    : of the layout; without one, of the states as they are
    layout, weights : for the compiled form
    """

    emission: Index
    arc_from: Index
    arc_log: Scores
    arc_start: Index
    beam: float
    order: Index
    place: Index
    layout: ArcLayout | None = None
    weights: ArcWeights | None = None

    def scores(self, first: Scores, log_emission: Scores) -> tuple[Scores, float]:
        """Return the best scores into every state, frame by frame, each frame's best taken off, and their sum."""
        delta = np.empty((len(log_emission), len(self.emission)), np.float32)
        delta[0] = first
        if self.layout is None or self.weights is None:
            return delta, self._fill(delta, log_emission)
        from lipmotion.kernels.compiled import viterbi

        _, _, runs, _, blocks, block_sources, _ = self.layout
        columns = self.emission[self.order].astype(np.uintp)  # signed ones might count from the end, and no vectors
        log_emission = np.ascontiguousarray(log_emission, np.float32)
        arcs = (runs, self.weights.runs, blocks, block_sources, self.weights.blocks)
        return delta, float(viterbi.scores(delta, log_emission, columns, *arcs, np.float32(-self.beam)))

    def _fill(self, delta: Scores, log_emission: Scores) -> float:
        """Compute all rows but the first, by NumPy."""
        arrivals = np.empty(len(self.arc_from), np.float32)
        shift = 0.0
        for frame in range(1, len(delta)):
            np.take(delta[frame - 1], self.arc_from, out=arrivals)
            arrivals += self.arc_log
            row = np.maximum.reduceat(arrivals, self.arc_start, out=delta[frame])
            row += log_emission[frame, self.emission]
            best = row.max()
            if best > -np.inf:
                row -= best
                row[row < np.float32(-self.beam)] = -np.inf
                shift += float(best)
        return shift

    def trace(self, path: Index, delta: Scores, state: int) -> None:
        """Fill in the states before ``state`` in the last frame: recomputed, so that no back-pointers are stored."""
        if self.layout is not None:
            from lipmotion.kernels.compiled import viterbi

            viterbi.trace(path, delta, state, self.place, self.arc_from, self.arc_log, self.arc_start)
            return
        stops = np.append(self.arc_start[1:], len(self.arc_from))
        for frame in range(len(path) - 1, -1, -1):
            arcs = slice(self.arc_start[state], stops[state])
            sources = self.arc_from[arcs]
            state = int(sources[(delta[frame, sources] + self.arc_log[arcs]).argmax()])
            path[frame] = state


def _laid_out(arcs: tuple[Index, Index, Scores, Index, float], layout: ArcLayout) -> _Search:
    return _Search(*arcs, layout.order, layout.place, layout, arc_weights(layout, arcs[2], -np.inf))
