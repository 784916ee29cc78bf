"""Best paths through networks, in NumPy for a short recording, which must not wait for numba, and compiled.

Both forms give the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import isqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiler import compiled, pays

Index = NDArray[np.intp]
Array = NDArray[np.float64]
Scores = NDArray[np.float32]
LogEmission = Callable[[int, int], NDArray[np.float32]]
"""Function of a first frame and an end: returns the log densities of these frames [shape=(end - first, G)]."""
BLOCK, BLOCK_SCORES = 2048, 1 << 22
"""Frames whose scores are in memory at a time, and scores, whichever are more; earlier ones are computed again."""
WINDOW_BLOCK = 512
"""Frames that are searched at a time, through the states that may have one of them; scores before them are computed
again from checkpoints."""
MANY_ARCS = 1000  # so many arcs take NumPy as long in a frame as the calls of its functions
IMPOSSIBLE = np.float32(-np.inf)


class NetworkArrays(NamedTuple):
    """A network of S states and E arcs; logarithms are of probabilities.

    emission    : [shape=(S,)], the density of each state
    arc_from    : [shape=(E,)], the source states of all arcs, sorted by target
    arc_log     : [shape=(E,)], of the arcs
    arc_start   : [shape=(S,)], the first arc of each target; every state has at least one
    log_initial, log_final : [shape=(S,)], of beginning and ending in each state
    """

    emission: Index
    arc_from: Index
    arc_log: NDArray[np.floating[Any]]
    arc_start: Index
    log_initial: NDArray[np.floating[Any]]
    log_final: NDArray[np.floating[Any]]


class Windows(NamedTuple):
    """The frames that each state may have, from the first to before the end [shape=(S,)]; neither may decrease."""

    first: Index
    end: Index


def best_path(
    log_emission: LogEmission,
    count: int,
    network: NetworkArrays,
    windows: Windows | None = None,
    block_frames: int | None = None,
) -> tuple[Index, float]:
    """Return the most probable path and its log probability (-inf: no path).

    log_emission : of G densities; called for the frames of a block and one at most, for each twice with the same result
    count        : frames, T
    network      : logarithms in single precision
    windows      : the frames that each state may have; None: any
    block_frames : frames whose scores are in memory at a time, B; None: as many as are fastest
    Returns the states of the path [shape=(T,)], and its score. Scores are relative to the best of their frame and in
    single precision: no path is lost, but one may be preferred to another that is better by less than their rounding.
    Cost: O(T·E) time, O((T / B + B)·(S + G)) memory; with windows E and S are of those that have windows in one block.
    """
    length = block_frames or (WINDOW_BLOCK if windows else max(BLOCK, BLOCK_SCORES // len(network.emission)))
    starts = range(0, max(count - 1, 1), length)
    blocks = [_Block(network, windows, start, min(start + length + 1, count)) for start in starts]
    path = np.full(count, -1, np.intp)
    if any(block.states.start >= block.states.stop for block in blocks):
        return path, -np.inf
    is_compiled = pays(count * (1 + sum(block.arcs for block in blocks) // len(blocks) // MANY_ARCS))

    def scores(block: _Block, row: Scores) -> tuple[Scores, float]:
        return _scores(block.network, row, block.log_emission(log_emission), is_compiled)

    rows, total = [blocks[0].first_row(log_emission)], 0.0
    for block, following in pairwise(blocks):
        delta, shift = scores(block, rows[-1])
        rows.append(following.row_after(block, delta[-1]))
        total += shift
    for block, row in zip(reversed(blocks), reversed(rows), strict=True):
        delta, shift = scores(block, row)
        if path[-1] < 0:
            last = delta[-1] + block.network.log_final
            total += shift + float(last.max())
            path[-1] = block.states.start + last.argmax()
            if not np.isfinite(total):
                break
        part = path[block.start : block.stop - 1]
        _trace(block.network, part, delta, int(path[block.stop - 1]) - block.states.start, is_compiled)
        part += block.states.start
    return path, total


class _Block:
    """Some frames, and the states that may have one of them: consecutive ones, in a network of their own."""

    def __init__(self, network: NetworkArrays, windows: Windows | None, start: int, stop: int):
        self.full_network, self.windows, self.start, self.stop = network, windows, start, stop
        self.states = slice(0, len(network.emission))
        if windows is not None:
            first = int(np.searchsorted(windows.end, start, side="right"))
            self.states = slice(first, int(np.searchsorted(windows.first, stop)))
        edges = np.append(network.arc_start, len(network.arc_from))
        self._arcs = slice(int(edges[self.states.start]), int(edges[self.states.stop]))
        self.arcs = self._arcs.stop - self._arcs.start

    def first_row(self, log_emission: LogEmission) -> Scores:
        """Return the scores of the states in the first frame of all."""
        values = self._mask(log_emission(0, 1), 0)[0]
        if self.windows is None:
            values = values[self.full_network.emission]
        return self.full_network.log_initial[self.states] + values

    def row_after(self, before: _Block, last: Scores) -> Scores:
        """Return the scores in the first frame, from those of the block before in its last frame."""
        row = np.full(self.states.stop - self.states.start, -np.inf, np.float32)
        first, stop = max(self.states.start, before.states.start), min(self.states.stop, before.states.stop)
        if first < stop:
            here, there = self.states.start, before.states.start
            row[first - here : stop - here] = last[first - there : stop - there]
        return row

    def log_emission(self, log_emission: LogEmission) -> Scores:
        """Return the log densities as ``network`` numbers them: of every state, -inf outside its window."""
        return self._mask(log_emission(self.start, self.stop), self.start)

    def _mask(self, values: Scores, start: int) -> Scores:
        if self.windows is None:
            return values
        values = values[:, self.full_network.emission[self.states]]
        frames = np.arange(start, start + len(values))[:, None]
        outside = (frames < self.windows.first[self.states]) | (frames >= self.windows.end[self.states])
        values[outside] = -np.inf
        return values

    @property
    def network(self) -> NetworkArrays:
        """The network of the states; arcs from others are left out."""
        if self.windows is None:
            return self.full_network
        first, network = self.states.start, self.full_network
        sources = network.arc_from[self._arcs]
        inside = (sources >= first) & (sources < self.states.stop)
        position = np.append(0, np.cumsum(inside))
        return NetworkArrays(
            np.arange(self.states.stop - first),
            sources[inside] - first,
            network.arc_log[self._arcs][inside],
            position[network.arc_start[self.states] - self._arcs.start],
            network.log_initial[self.states],
            network.log_final[self.states],
        )


def _scores(network: NetworkArrays, first: Scores, log_emission: Scores, is_compiled: bool) -> tuple[Scores, float]:
    """Return the scores of the best path to every state, relative to each frame's best, and the sum of these best."""
    emission, arc_from, arc_log, arc_start, _, _ = network
    delta = np.empty((len(log_emission), len(emission)), np.float32)
    delta[0] = first
    if is_compiled:
        arc_log, log_emission = (np.ascontiguousarray(part, np.float32) for part in (arc_log, log_emission))
        columns, sources = emission.astype(np.uintp), arc_from.astype(np.uintp)  # others are not vectorised
        stops = np.append(arc_start[1:], len(arc_from))
        return delta, float(_fill(delta, columns, sources, log_emission, arc_log, stops))
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


def _trace(network: NetworkArrays, path: Index, delta: Scores, state: int, is_compiled: bool) -> None:
    """Fill in the path before ``state`` in the last frame of ``delta``: without back-pointers, from the scores."""
    _, arc_from, arc_log, arc_start, _, _ = network
    stops = np.append(arc_start[1:], len(arc_from))
    if is_compiled:
        _trace_back(path, delta, state, arc_from, np.asarray(arc_log, np.float32), arc_start, stops)
        return
    for frame in range(len(path) - 1, -1, -1):
        arcs = slice(arc_start[state], stops[state])
        sources = arc_from[arcs]
        state = int(sources[(delta[frame, sources] + arc_log[arcs]).argmax()])
        path[frame] = state


@compiled
def _fill(
    delta: Scores, emission: NDArray[np.uintp], arc_from: NDArray[np.uintp], log_emission: Scores, arc_log: Scores,
    arc_stop: Index,
) -> float:  # fmt: skip
    """Fill in all scores but the first ones; return the sum of the frames' best ones."""
    shift = 0.0
    for t in range(1, len(delta)):
        before, after, best, first = delta[t - 1], delta[t], IMPOSSIBLE, 0
        for state in range(len(after)):
            a = b = c = d = IMPOSSIBLE  # four running maxima: a single one waits for itself
            stop = arc_stop[state]
            blocks_end = first + (stop - first) // 4 * 4
            for arc in range(first, blocks_end, 4):
                a = max(a, before[arc_from[arc]] + arc_log[arc])
                b = max(b, before[arc_from[arc + 1]] + arc_log[arc + 1])
                c = max(c, before[arc_from[arc + 2]] + arc_log[arc + 2])
                d = max(d, before[arc_from[arc + 3]] + arc_log[arc + 3])
            for arc in range(blocks_end, stop):
                a = max(a, before[arc_from[arc]] + arc_log[arc])
            first = stop
            after[state] = max(a, b, c, d) + log_emission[t, emission[state]]
            best = max(best, after[state])
        if best > IMPOSSIBLE:
            for state in range(len(after)):
                after[state] -= best
            shift += float(best)
    return shift


@compiled
def _trace_back(
    path: Index, delta: Scores, state: int, arc_from: Index, arc_log: Scores, arc_start: Index, arc_stop: Index
) -> None:
    """Fill in the path [shape=(T - 1,)] before ``state`` in the last of T frames."""
    for t in range(len(path) - 1, -1, -1):
        best, source = IMPOSSIBLE, arc_from[arc_start[state]]
        for arc in range(arc_start[state], arc_stop[state]):
            score = delta[t, arc_from[arc]] + arc_log[arc]
            if score > best:
                best, source = score, arc_from[arc]
        state = path[t] = source


def find_cheapest(start: Array, steps: Array) -> tuple[Array, NDArray[np.uint8]]:
    """Return the cost of the cheapest path to each last state [shape=(C,)], and back-pointers [shape=(T, C)].

    start : cost of each state before the first step [shape=(C,)]; infinite: impossible
    steps : cost of going from state i to state j [shape=(C, C, T), i first]; for every j one is finite, C ≤ 256
    Ties go to the lower state. A long recording is processed by stretches: the costs returned start the next stretch.
    Exact: Viterbi, Δ_t(j) = min_i Δ_{t−1}(i) + steps(i, j, t). In the algebra of (min, +) a piece of √T frames is one
    C × C matrix; first these of all pieces at once, then costs between pieces in turn, then within all pieces at once.
    Cost: O(T·C³) time in O(√T) array operations, O(T·C²) memory.
    """
    states, frames = len(start), steps.shape[2]
    length = isqrt(frames - 1) + 1
    count = -(-frames // length)
    padded = np.empty((states, states, count * length))
    padded[..., :frames] = steps
    padded[..., frames:] = np.where(np.eye(states), 0.0, np.inf)[..., None]  # to stay costs nothing
    pieces = np.ascontiguousarray(padded.reshape(states, states, count, length).transpose(3, 0, 1, 2))
    products = pieces[0]
    for step in pieces[1:]:
        products = (products[:, :, None] + step).min(axis=1)
    before = np.empty((length, states, count))  # the cost of every state before each frame of every piece
    before[0, :, 0] = start
    for piece in range(count - 1):
        before[0, :, piece + 1] = (before[0, :, piece, None] + products[:, :, piece]).min(axis=0)
    for frame in range(length - 1):
        before[frame + 1] = (before[frame][:, None] + pieces[frame]).min(axis=0)
    ways = before[:, :, None] + pieces
    arrivals, pointers = ways[:, 0].copy(), np.zeros((length, states, count), np.uint8)
    for state in range(1, states):
        pointers[ways[:, state] < arrivals] = state
        np.minimum(arrivals, ways[:, state], out=arrivals)
    return arrivals[-1, :, -1], pointers.transpose(2, 0, 1).reshape(-1, states)[:frames]


def trace_back(pointers: NDArray[np.uint8], last: int) -> NDArray[np.intp]:
    """Return the state of every frame [shape=(T,)] on the path that ends in state ``last``."""
    states, table = pointers.shape[1], pointers.tobytes()
    path = [last]
    for row in range(len(table) - states, 0, -states):
        path.append(table[row + path[-1]])
    return np.array(path[::-1], np.intp)


def find_segments(cost: NDArray[np.float64], hold: int, change: float) -> list[tuple[int, int]]:
    """Return the segments (first frame, label) of least cost, in order; neighbours differ in label.

    cost   : [shape=(T, S), finite], of label s in frame t
    hold   : least frames of a segment, > 0; with fewer frames in all, one segment has them all
    change : cost of every segment after the first, >= 0
    No frames: no segments. Ties go to the earlier label and to the longer segment.
    Exact: a segment of label s that ends with frame t either began ``hold`` frames ago, after the best division of
    what came before, or is one frame longer than one that ended with frame t − 1.
    Cost: O(T·S) time and memory.
    """
    frames = len(cost)
    if not frames:
        return []
    hold = min(hold, frames)
    best = np.full(frames + 1, np.inf)
    best[0] = 0.0
    label = np.zeros(frames + 1, np.intp)
    began = np.zeros((frames + 1, cost.shape[1]), bool)
    open_segments = np.full(cost.shape[1], np.inf)
    for end in range(hold, frames + 1):
        open_segments += cost[end - 1]
        begun = cost[end - hold : end].sum(axis=0) + (best[end - hold] + change)
        np.less(begun, open_segments, out=began[end])
        np.minimum(begun, open_segments, out=open_segments)
        label[end] = open_segments.argmin()
        best[end] = open_segments[label[end]]
    segments: list[tuple[int, int]] = []
    end = frames
    while end > 0:
        current = int(label[end])
        while not began[end, current]:
            end -= 1
        end -= hold
        if segments and segments[-1][1] == current:  # split by rounding alone, where a change is free
            segments.pop()
        segments.append((end, current))
    return segments[::-1]
