"""The scores of best paths, compiled: the results are those of ``kernels.sequences.viterbi`` to the bit."""

# Functions take their arrays as separate arguments, more than eight in places: numba compiles that to the fastest code.

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiled.compiler import compiled

Index = NDArray[np.intp]
Row = NDArray[np.float32]
IMPOSSIBLE = np.float32(-np.inf)


@compiled
def scores(
    delta: Row, log_emission: Row, columns: NDArray[np.uintp],
    runs: Index, run_log: Row, blocks: Index, block_sources: Index, block_log: Row, least: np.float32,
) -> float:  # fmt: skip
    """Fill in the scores by place [shape=(T, S)] from the first row on; return the sum of the frames' best scores.

    delta        : scores relative to the best of each frame
    log_emission : [shape=(T, G)];  columns : [shape=(S,)], the column of the state at each place
    runs ... block_log : of the layout and its weights (``kernels.sequences.arcs``)
    least        : relative scores under this become -inf
    """
    shift = 0.0
    enter = np.empty(block_log.shape[1], np.float32)
    for t in range(1, len(delta)):
        delta[t] = IMPOSSIBLE
        _follow_runs(delta[t - 1], delta[t], runs, run_log)
        for b in range(len(blocks)):
            target, targets, first, sources = blocks[b]
            matrix, into = block_log[first : first + sources], delta[t, target : target + targets]
            _follow_block(delta[t - 1], into, block_sources[first:], matrix, enter)
        _emit(delta[t], log_emission[t], columns)
        best = _greatest(delta[t])
        if best > IMPOSSIBLE:
            _relative(delta[t], best, least)
            shift += float(best)
    return shift


@compiled
def scores_by_arcs(
    delta: Row, log_emission: Row, columns: NDArray[np.uintp], arc_from: NDArray[np.uintp], arc_log: Row,
    arc_stop: Index, least: np.float32,
) -> float:  # fmt: skip
    """Return what ``scores`` does, with the states in their own order: for networks whose arcs form no long runs.

    arc_from, arc_log : of all arcs, sorted by target;  arc_stop : [shape=(S,)], the end of each target's arcs
    """
    shift = 0.0
    for t in range(1, len(delta)):
        before, after, best, first = delta[t - 1], delta[t], IMPOSSIBLE, 0
        for state in range(len(after)):
            score = IMPOSSIBLE
            for arc in range(first, arc_stop[state]):
                score = max(score, before[arc_from[arc]] + arc_log[arc])
            first = arc_stop[state]
            after[state] = score + log_emission[t, columns[state]]
            best = max(best, after[state])
        if best > IMPOSSIBLE:
            _relative(after, best, least)
            shift += float(best)
    return shift


@compiled
def _follow_runs(before: Row, after: Row, runs: Index, run_log: Row) -> None:
    for r in range(len(runs)):
        target, source, length, first = runs[r]
        into, out, log_weight = after[target : target + length], before[source:], run_log[first:]
        for i in range(len(into)):
            score = out[i] + log_weight[i]
            into[i] = score if score > into[i] else into[i]


@compiled
def _follow_block(before: Row, after: Row, sources: Index, log_weight: Row, enter: Row) -> None:
    enter[:] = IMPOSSIBLE
    for s in range(len(log_weight)):
        score = before[sources[s]]
        if score > IMPOSSIBLE:
            for i in range(len(enter)):
                arriving = score + log_weight[s, i]
                enter[i] = arriving if arriving > enter[i] else enter[i]
    for i in range(len(after)):
        after[i] = enter[i] if enter[i] > after[i] else after[i]


@compiled
def _emit(row: Row, log_emission: Row, columns: NDArray[np.uintp]) -> None:
    for i in range(len(row)):
        row[i] += log_emission[columns[i]]


@compiled
def _greatest(row: Row) -> np.float32:
    """Return the greatest value, by eight running maxima: a single one is not vectorised."""
    a = b = c = d = e = f = g = h = IMPOSSIBLE
    whole = len(row) // 8 * 8
    for i in range(0, whole, 8):
        a, b = max(row[i], a), max(row[i + 1], b)
        c, d = max(row[i + 2], c), max(row[i + 3], d)
        e, f = max(row[i + 4], e), max(row[i + 5], f)
        g, h = max(row[i + 6], g), max(row[i + 7], h)
    for i in range(whole, len(row)):
        a = max(row[i], a)
    return max(a, b, c, d, e, f, g, h)


@compiled
def _relative(row: Row, best: np.float32, least: np.float32) -> None:
    for i in range(len(row)):
        score = row[i] - best
        row[i] = score if score >= least else IMPOSSIBLE


@compiled
def trace(path: Index, delta: Row, state: int, place: Index, arc_from: Index, arc_log: Row, arc_start: Index) -> None:
    """Fill in the path [shape=(T - 1,)] before ``state`` in the last of T frames."""
    for t in range(len(path) - 1, -1, -1):
        stop = arc_start[state + 1] if state + 1 < len(arc_start) else len(arc_from)
        best, source = IMPOSSIBLE, arc_from[arc_start[state]]
        for arc in range(arc_start[state], stop):
            score = delta[t, place[arc_from[arc]]] + arc_log[arc]
            if score > best:
                best, source = score, arc_from[arc]
        state = path[t] = source
