"""The best state path through a network of states."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

LogEmission = Callable[[int, int], NDArray[np.float32]]
"""Gives the log densities of the frames from one up to another [shape=(frames, G)], the same at every call."""
BLOCK = 2048
"""Frames whose scores are kept at a time; earlier ones are computed again from checkpoints."""


def best_path(
    log_emission: LogEmission,
    count: int,
    emission: NDArray[np.intp],
    arc_from: NDArray[np.intp],
    arc_log: NDArray[np.float32],
    arc_start: NDArray[np.intp],
    log_initial: NDArray[np.float32],
    log_final: NDArray[np.float32],
) -> tuple[NDArray[np.intp], float]:
    """Return the most probable path and its log probability (-inf: no path).

    log_emission : of G emission densities; asked for at most ``BLOCK`` + 1 frames at a time, for each at most twice
    count        : frames, T
    emission     : [shape=(S,)], the density of each of S states
    arc_from     : [shape=(E,)], the source states of all arcs, sorted by target
    arc_log      : [shape=(E,)]
    arc_start    : [shape=(S,)], where each target's arcs begin; every state has at least one
    log_initial, log_final : [shape=(S,)]
    Returns path [shape=(T,)], score.
    Cost: O(T·E) time, O((T / BLOCK + BLOCK)·(S + G)) memory.
    """
    arcs = (emission, arc_from, arc_log, arc_start)
    starts = range(0, count, BLOCK)
    first = (log_initial + log_emission(0, 1)[0, emission])[None]
    checkpoints, score = [first[0]], 0.0
    for start in starts[1:]:
        delta, shift = _scores(checkpoints[-1], log_emission(start - BLOCK, start + 1), *arcs)
        checkpoints.append(delta[-1].copy())  # a view would keep the whole block
        score += shift
    path = np.empty(count, np.intp)
    state = -1
    for start, checkpoint in zip(reversed(starts), reversed(checkpoints), strict=True):
        stop = min(start + BLOCK + 1, count)
        delta, shift = _scores(checkpoint, log_emission(start, stop), *arcs)
        if state < 0:
            last = delta[-1] + log_final
            state = int(last.argmax())
            score += shift + float(last[state])
            path[-1] = state
        for frame in range(stop - 1, start, -1):
            state = _predecessor(delta[frame - start - 1], state, arc_from, arc_log, arc_start)
            path[frame - 1] = state
    return path, score


def _scores(
    first: NDArray[np.float32],
    log_emission: NDArray[np.float32],
    emission: NDArray[np.intp],
    arc_from: NDArray[np.intp],
    arc_log: NDArray[np.float32],
    arc_start: NDArray[np.intp],
) -> tuple[NDArray[np.float32], float]:
    """Return the best scores into every state, frame by frame, each frame's best taken off, and their sum."""
    delta = np.empty((len(log_emission), len(emission)), np.float32)
    delta[0] = first
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
            shift += float(best)
    return delta, shift


def _predecessor(
    delta: NDArray[np.float32],
    state: int,
    arc_from: NDArray[np.intp],
    arc_log: NDArray[np.float32],
    arc_start: NDArray[np.intp],
) -> int:
    """Return where the best path into ``state`` came from: recomputed, so that no back-pointers are stored."""
    begin = arc_start[state]
    end = arc_start[state + 1] if state + 1 < len(arc_start) else len(arc_from)
    sources = arc_from[begin:end]
    return int(sources[(delta[sources] + arc_log[begin:end]).argmax()])
