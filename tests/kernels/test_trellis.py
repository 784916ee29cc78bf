import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.kernels.paths import cheapest_arrivals, trace_back
from oracles import trellis

SEEDS = st.integers(0, 2**32 - 1)


def costs(states: int, frames: int, seed: int):
    """Return costs of which a quarter is infinite; to stay is possible."""
    random = np.random.default_rng(seed)
    steps = random.exponential(1, (states, states, frames))
    steps[random.random(steps.shape) < 0.25] = np.inf
    steps[range(states), range(states)] = random.exponential(2, (states, frames))
    return random.exponential(1, states), steps


@settings(max_examples=150)
@given(states=st.integers(1, 3), frames=st.integers(1, 6), seed=SEEDS)
def test_no_path_is_cheaper(states: int, frames: int, seed: int) -> None:
    start, steps = costs(states, frames, seed)
    arrival, pointers = cheapest_arrivals(start, steps)
    path, cost = trellis.cheapest_path(start, steps)
    assert arrival.min() == pytest.approx(cost)
    assert trace_back(pointers, int(arrival.argmin())).tolist() == path


@settings(max_examples=60)
@given(states=st.integers(1, 6), frames=st.integers(1, 300), seed=SEEDS)
def test_every_last_state_is_reached_at_least_cost_by_the_way_traced(states: int, frames: int, seed: int) -> None:
    start, steps = costs(states, frames, seed)
    arrival, pointers = cheapest_arrivals(start, steps)
    assert pointers.shape == (frames, states)
    assert arrival == pytest.approx(trellis.arrivals(start, steps))
    for last in range(states):
        path = trace_back(pointers, last).tolist()
        assert trellis.path_cost([pointers[0, path[0]], *path], start, steps) == pytest.approx(arrival[last])


@settings(max_examples=40)
@given(frames=st.integers(2, 200), cut=st.integers(1, 199), seed=SEEDS)
def test_stretches_are_the_whole(frames: int, cut: int, seed: int) -> None:
    start, steps = costs(4, frames, seed)
    whole, pointers = cheapest_arrivals(start, steps)
    cut = min(cut, frames - 1)
    between, first = cheapest_arrivals(start, steps[..., :cut])
    arrival, second = cheapest_arrivals(between, steps[..., cut:])
    assert arrival == pytest.approx(whole)
    assert np.concatenate([first, second]).tolist() == pointers.tolist()


def test_ties_go_to_the_lower_state() -> None:
    _, pointers = cheapest_arrivals(np.zeros(3), np.zeros((3, 3, 20)))
    assert not pointers.any()


def test_what_cannot_be_is_not_chosen() -> None:
    steps = np.zeros((2, 2, 10))
    steps[:, 0, 5] = np.inf
    arrival, pointers = cheapest_arrivals(np.array([0.0, np.inf]), steps + np.array([0.0, 1.0])[:, None])
    assert trace_back(pointers, int(arrival.argmin())).tolist() == [0, 0, 0, 0, 0, 1, 0, 0, 0, 0]
