import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.kernels.paths import find_cheapest, find_segments, trace_back
from oracles import paths

SEEDS = st.integers(0, 2**32 - 1)


def costs(states: int, frames: int, seed: int):
    """Return costs of which a quarter is infinite; to stay is possible."""
    random = np.random.default_rng(seed)
    steps = random.exponential(1, (states, states, frames))
    steps[random.random(steps.shape) < 0.25] = np.inf
    steps[range(states), range(states)] = random.exponential(2, (states, frames))
    return random.exponential(1, states), steps


@settings(max_examples=60)
@given(states=st.integers(1, 6), frames=st.integers(1, 300), seed=SEEDS)
def test_every_last_state_is_reached_at_least_cost_by_the_way_traced(states: int, frames: int, seed: int) -> None:
    start, steps = costs(states, frames, seed)
    arrival, pointers = find_cheapest(start, steps)
    assert pointers.shape == (frames, states)
    assert arrival == pytest.approx(paths.arrivals(start, steps))
    for last in range(states):
        path = trace_back(pointers, last).tolist()
        taken = zip([pointers[0, path[0]], *path], path, range(frames), strict=False)
        assert start[pointers[0, path[0]]] + sum(steps[each] for each in taken) == pytest.approx(arrival[last])


@settings(max_examples=40)
@given(frames=st.integers(2, 200), cut=st.integers(1, 199), seed=SEEDS)
def test_stretches_are_the_whole(frames: int, cut: int, seed: int) -> None:
    start, steps = costs(4, frames, seed)
    whole, pointers = find_cheapest(start, steps)
    cut = min(cut, frames - 1)
    between, first = find_cheapest(start, steps[..., :cut])
    arrival, second = find_cheapest(between, steps[..., cut:])
    np.testing.assert_allclose(arrival, whole, rtol=1e-6, equal_nan=False)
    assert np.concatenate([first, second]).tolist() == pointers.tolist()


def test_ties_go_to_the_lower_state_and_what_cannot_be_is_not_chosen() -> None:
    _, pointers = find_cheapest(np.zeros(3), np.zeros((3, 3, 20)))
    assert not pointers.any()
    steps = np.zeros((2, 2, 10))
    steps[:, 0, 5] = np.inf
    arrival, pointers = find_cheapest(np.array([0.0, np.inf]), steps + np.array([0.0, 1.0])[:, None])
    assert trace_back(pointers, int(arrival.argmin())).tolist() == [0, 0, 0, 0, 0, 1, 0, 0, 0, 0]


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
    found = find_segments(cost, hold, change)
    assert paths.is_division(found, frames, hold)
    _, least = paths.best_division(cost, hold, change)
    assert paths.division_cost(found, cost, change) == pytest.approx(least, abs=1e-9)


def test_without_a_hold_it_is_the_cheapest_of_every_frame_and_a_dear_change_leaves_one_segment() -> None:
    cost = np.random.default_rng(1).normal(0, 1, (200, 5))
    labels = np.empty(200, int)
    for first, label in find_segments(cost, 1, 0.0):
        labels[first:] = label
    assert (labels == cost.argmin(axis=1)).all()
    assert find_segments(np.empty((0, 9)), 2, 0.5) == []
    assert find_segments(cost, 2, 1e6) == [(0, int(cost.sum(axis=0).argmin()))]
