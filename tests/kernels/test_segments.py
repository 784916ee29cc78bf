from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.kernels.paths import best_segments
from oracles import segments


@settings(max_examples=50)
@given(
    frames=st.integers(1, 8),
    labels=st.integers(1, 3),
    hold=st.integers(1, 10),
    change=st.sampled_from([0.0, 0.3, 2.0]),
    seed=st.integers(0, 2**32 - 1),
)
def test_no_division_is_cheaper(frames: int, labels: int, hold: int, change: float, seed: int) -> None:
    cost = np.random.default_rng(seed).normal(0, 1, (frames, labels))
    found = best_segments(cost, hold, change)
    assert segments.is_division(found, frames, hold)
    _, least = segments.best_division(cost, hold, change)
    assert segments.division_cost(found, cost, change) == pytest.approx(least, abs=1e-9)


@settings(max_examples=15)
@given(frames=st.integers(1, 300), hold=st.integers(1, 12), seed=st.integers(0, 2**32 - 1))
def test_every_segment_is_held(frames: int, hold: int, seed: int) -> None:
    found = best_segments(np.random.default_rng(seed).exponential(3, (frames, 9)), hold, 0.0)
    assert segments.is_division(found, frames, hold)


@settings(max_examples=25)
@given(st.integers(1, 60), st.integers(1, 5), st.integers(0, 2**32 - 1))
def test_ties_neither_split_nor_shorten(frames: int, hold: int, seed: int) -> None:
    cost = np.random.default_rng(seed).integers(0, 2, (frames, 3)).astype(float)
    found = best_segments(cost, hold, 0.0)
    assert all(before[1] != after[1] for before, after in pairwise(found))
    assert segments.is_division(found, frames, hold)


def test_without_a_hold_it_is_the_cheapest_of_every_frame() -> None:
    cost = np.random.default_rng(1).normal(0, 1, (200, 5))
    labels = np.empty(200, int)
    for first, label in best_segments(cost, 1, 0.0):
        labels[first:] = label
    assert (labels == cost.argmin(axis=1)).all()


def test_a_dear_change_leaves_one_segment() -> None:
    cost = np.random.default_rng(2).normal(0, 1, (200, 5))
    assert best_segments(np.empty((0, 9)), 2, 0.5) == []
    assert best_segments(cost, 2, 1e6) == [(0, int(cost.sum(axis=0).argmin()))]
