"""Cheapest paths in which every frame has one of few labels: with a cost for every change, or with a least duration.

NumPy is fast enough for both.
"""

from __future__ import annotations

from math import isqrt

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def cheapest_arrivals(start: Array, steps: Array) -> tuple[Array, NDArray[np.uint8]]:
    """Return the cost of the cheapest path to each last state [shape=(C,)], and back-pointers [shape=(T, C)].

    start : cost of each state before the first step [shape=(C,)]; infinite: impossible
    steps : cost of going from state i to state j [shape=(C, C, T), i first]; for every j one is finite, C ≤ 256
    Ties go to the lower state. A long recording is processed by stretches: the costs returned start the next stretch.
    Exact: Viterbi, Δ_t(j) = min_i Δ_{t−1}(i) + steps(i, j, t). In the algebra of (min, +) a piece of √T frames is
    one C × C matrix; first these of all pieces at once, then the costs between pieces, one after another, then the
    costs within all pieces at once.
    Cost: O(T·C³) time in O(√T) array operations, O(T·C²) memory.
    """
    states, frames = len(start), steps.shape[2]
    pieces = _in_pieces(steps)
    before = np.empty((len(pieces), states, pieces.shape[3]))
    before[0] = _entries(start, _products(pieces))
    for frame in range(len(pieces) - 1):
        before[frame + 1] = (before[frame][:, None] + pieces[frame]).min(axis=0)
    arrivals, pointers = _cheapest(before[:, :, None] + pieces)
    in_order = pointers.transpose(2, 0, 1).reshape(-1, states)[:frames]
    return arrivals[-1, :, -1], in_order


def trace_back(pointers: NDArray[np.uint8], last: int) -> NDArray[np.intp]:
    """Return the state of every frame [shape=(T,)] on the path that ends in state ``last``."""
    states, table = pointers.shape[1], pointers.tobytes()
    path = [last]
    for row in range(len(table) - states, 0, -states):
        path.append(table[row + path[-1]])
    return np.array(path[::-1], np.intp)


def _in_pieces(steps: Array) -> Array:
    """Return the steps [shape=(length, C, C, pieces)]; in padding, staying in a state costs nothing."""
    states, _, frames = steps.shape
    length = isqrt(frames - 1) + 1
    count = -(-frames // length)
    padded = np.empty((states, states, count * length))
    padded[..., :frames] = steps
    padded[..., frames:] = np.where(np.eye(states), 0.0, np.inf)[..., None]
    return np.ascontiguousarray(padded.reshape(states, states, count, length).transpose(3, 0, 1, 2))


def _products(pieces: Array) -> Array:
    """Return the cost of the cheapest path through each piece, from each state to each [shape=(C, C, pieces)]."""
    product = pieces[0]
    for step in pieces[1:]:
        product = (product[:, :, None] + step).min(axis=1)
    return product


def _entries(start: Array, products: Array) -> Array:
    """Return the cost of every state before each piece [shape=(C, pieces)]."""
    entries = np.empty((len(start), products.shape[2]))
    entries[:, 0] = start
    for piece in range(entries.shape[1] - 1):
        entries[:, piece + 1] = (entries[:, piece, None] + products[:, :, piece]).min(axis=0)
    return entries


def _cheapest(ways: Array) -> tuple[Array, NDArray[np.uint8]]:
    """Return the least cost over states before, and which [shapes=(length, C, pieces)], of ways [shape=(length, C, C,
    pieces)].
    """
    least, which = ways[:, 0].copy(), np.zeros((len(ways), *ways.shape[2:]), np.uint8)
    for state in range(1, ways.shape[1]):
        which[ways[:, state] < least] = state
        np.minimum(least, ways[:, state], out=least)
    return least, which


def best_segments(cost: NDArray[np.float64], hold: int, change: float) -> list[tuple[int, int]]:
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
    return _segments(label, began, hold)


def _segments(label: NDArray[np.intp], began: NDArray[np.bool_], hold: int) -> list[tuple[int, int]]:
    """Return the segments, from the best label at each end, and whether one of it began ``hold`` frames before."""
    segments: list[tuple[int, int]] = []
    end = len(label) - 1
    while end > 0:
        current = int(label[end])
        while not began[end, current]:
            end -= 1
        end -= hold
        if segments and segments[-1][1] == current:  # split by rounding alone, where a change is free
            segments.pop()
        segments.append((end, current))
    return segments[::-1]
