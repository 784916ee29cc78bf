"""The cheapest division of time into segments of a least duration."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


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
    return _trace_back(label, began, hold)


def _trace_back(label: NDArray[np.intp], began: NDArray[np.bool_], hold: int) -> list[tuple[int, int]]:
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
