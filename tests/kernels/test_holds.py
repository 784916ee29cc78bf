from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion.articulation.delivery import choose_holds


def error(rows: NDArray[np.float64], borders: list[int], fixed: list[int]) -> float:
    """Return the sum of squared differences between curves and held poses."""
    total = 0.0
    for first, stop in pairwise(borders):
        inside = [frame for frame in fixed if first <= frame < stop]
        pose = rows[inside].mean(axis=0) if inside else rows[first:stop].mean(axis=0)
        total += float(((rows[first:stop] - pose) ** 2).sum())
    return total


def least_error(rows: NDArray[np.float64], hold: int, fixed: list[int]) -> float:
    """Return the least error of all divisions into poses of ``hold`` frames or more, one after another.

    With fixed frames, of those into poses of ``hold`` to 2 · ``hold`` − 1 frames.
    """
    longest = 2 * hold - 1 if fixed else len(rows)
    best = {0: 0.0}
    for stop in range(1, len(rows) + 1):
        starts = [first for first in best if hold <= stop - first <= longest]
        if starts:
            best[stop] = min(best[first] + error(rows, [first, stop], fixed) for first in starts)
    return best[len(rows)]


def test_no_division_is_nearer() -> None:
    for seed in (*range(10), 189):  # in the last, a pose of twice the hold would be nearer
        rng = np.random.default_rng(seed)
        hold = int(rng.integers(1, 6))
        rows = rng.normal(size=(int(rng.integers(2 * hold, 30)), 2)).cumsum(axis=0)
        fixed = sorted(rng.choice(len(rows), int(rng.integers(0, 3)), replace=False).tolist())
        borders = choose_holds(rows, hold, fixed)
        assert borders[0] == 0
        assert borders[-1] == len(rows)
        assert np.diff(borders).min() >= hold
        assert error(rows, borders, fixed) == pytest.approx(least_error(rows, hold, fixed), abs=1e-9)


def test_a_curve_of_steps_is_found_again() -> None:
    rows = np.repeat([0.0, 3.0, 1.0, 2.0], [5, 4, 6, 7])[:, None]
    borders = choose_holds(rows, 4)
    assert {5, 9, 15} <= set(borders)
    assert error(rows, borders, []) == pytest.approx(0, abs=1e-12)


def test_few_frames_are_one_pose() -> None:
    for frames, borders in ((0, [0]), (1, [0, 1]), (7, [0, 7])):
        assert choose_holds(np.arange(frames, dtype=float)[:, None], 4) == borders
