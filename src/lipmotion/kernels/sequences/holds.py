"""Held poses: the division of time into poses of a least duration that comes nearest to a curve."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def best_holds(rows: NDArray[np.float64], hold: int, fixed: Sequence[int] = ()) -> list[int]:
    """Return the first frame of every held pose, in order, and the number of frames after them [B + 1 numbers].

    rows  : curves over time, scaled so that their differences count alike [shape=(T, D)]
    hold  : least frames of a pose, > 0; with fewer frames in all, one pose has them all
    fixed : frames whose pose must be shown: the pose that has one is that frame's, of several the mean of these
    Every other pose is the mean of its frames. Of all divisions into poses of ``hold`` to 2 · ``hold`` - 1 frames, the
    one with the least sum of squared differences between curves and poses (dynamic programming, no approximation).
    Without fixed frames no other division is better: two poses are never worse than one of 2 · ``hold`` frames or
    more. With them a longer pose can be: it shows the mean of several fixed frames, where two show each more exactly.
    Cost: O(T · hold · D) time, O(T · D) memory.
    """
    frames = len(rows)
    if frames < 2 * hold or not frames:
        return [0, frames] if frames else [0]
    if hold == 1:
        return list(range(frames + 1))
    centred = rows - rows.mean(axis=0)
    marked = np.zeros(frames)
    marked[list(fixed)] = 1
    sums, squares = _sums(centred), _sums((centred**2).sum(axis=1))
    counts, marked_sums = _sums(marked), _sums(centred * marked[:, None])
    best = np.full(frames + 1, np.inf)
    best[0] = 0.0
    before = np.zeros(frames + 1, np.intp)
    for stop in range(hold, frames + 1):
        starts = np.arange(max(stop - 2 * hold + 1, 0), stop - hold + 1)
        length, total = stop - starts, sums[stop] - sums[starts]
        count, shown = counts[stop] - counts[starts], marked_sums[stop] - marked_sums[starts]
        is_fixed = count > 0
        pose = np.where(is_fixed[:, None], shown, total) / np.where(is_fixed, count, length)[:, None]
        cost = squares[stop] - squares[starts] - (pose * (2 * total - length[:, None] * pose)).sum(axis=1)
        reached = best[starts] + cost
        chosen = int(reached.argmin())
        best[stop], before[stop] = reached[chosen], starts[chosen]
    borders = [frames]
    while borders[-1] > 0:
        borders.append(int(before[borders[-1]]))
    return borders[::-1]


def _sums(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sums of the first n rows, for n from 0 to all of them [shape=(T + 1, ...)]."""
    return np.concatenate([np.zeros((1, *rows.shape[1:])), np.cumsum(rows, axis=0)])
