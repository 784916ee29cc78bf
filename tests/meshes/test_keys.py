"""Keys that are left out: the curves stay within the tolerance, and closed lips stay closed."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion.meshes.model.keys import EVERY_KEY, Thinning, place_keys

TIME_S = np.arange(300) / 100
ROWS = np.stack([np.sin(4 * TIME_S), np.abs(np.sin(9 * TIME_S)) ** 0.3, np.where(TIME_S < 1.5, 0.0, 0.4)], axis=1)
SMOOTH = (False, False, False)


def between(keys: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    time_s, rows = keys
    return np.stack([np.interp(TIME_S, time_s, column) for column in rows.T], axis=1)


@pytest.mark.parametrize("tolerance", [0.003, 0.01, 0.05])
def test_curves_stay_within_the_tolerance(tolerance: float) -> None:
    time_s, rows = place_keys(TIME_S, ROWS, SMOOTH, Thinning(tolerance))
    assert 4 < len(time_s) < len(TIME_S)
    assert (time_s[0], time_s[-1]) == (TIME_S[0], TIME_S[-1])
    assert np.abs(between((time_s, rows)) - ROWS).max() <= tolerance + 1e-12


def test_coarser_keys_are_fewer() -> None:
    counts = [len(Thinning(tolerance).choose(TIME_S, ROWS)) for tolerance in (0.0, 0.003, 0.01, 0.05, 2.0)]
    assert counts == sorted(counts, reverse=True)
    assert (counts[0], counts[-1]) == (300, 2)
    assert len(EVERY_KEY.choose(TIME_S[:0], ROWS[:0])) == 0


def test_closed_lips_stay_closed() -> None:
    kept = Thinning(2.0, (0.703, 2.995)).choose(TIME_S, ROWS)
    assert kept.tolist() == [0, 69, 70, 71, 298, 299]


def test_a_held_pose_still_changes_at_once() -> None:
    stepped = (False, False, True)
    time_s, rows = place_keys(TIME_S, ROWS, stepped, Thinning(0.05))
    rise = np.flatnonzero(np.diff(rows[:, 2]) > 0.3)
    assert len(rise) == 1
    assert time_s[rise[0] + 1] - time_s[rise[0]] == pytest.approx(0.001)
