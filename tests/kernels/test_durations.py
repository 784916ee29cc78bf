import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.kernels.durations import best_durations
from oracles import durations as slow


@settings(deadline=None)
@given(frames=st.integers(1, 9), states=st.integers(1, 4), longest=st.integers(1, 4), seed=st.integers(0, 200))
def test_no_other_lengths_are_better(frames, states, longest, seed):
    draw = np.random.default_rng(seed)
    emission = draw.normal(0, 3, (frames, states))
    duration = np.log(draw.dirichlet(np.ones(longest), states))
    longer = -draw.uniform(0.01, 2, states)
    lasted, score = best_durations(emission, duration, longer)
    expected, best = slow.best_durations(emission, duration, longer)
    assert score == pytest.approx(best, abs=1e-9)
    if expected is not None:
        assert lasted.sum() == frames
        assert slow.duration_score(lasted, emission, duration, longer) == pytest.approx(best, abs=1e-9)


def test_what_cannot_be_is_avoided():
    emission = np.zeros((6, 2))
    duration = np.log([[0.9, 1e-300, 0.1], [0.5, 0.25, 0.25]])
    duration[0, :2] = -np.inf  # the first lasts three frames or more
    emission[4:, 0] = -np.inf  # and no more than four
    lasted, score = best_durations(emission, duration, np.array([-5.0, -5.0]))
    assert lasted.tolist() == [3, 3]
    assert score == pytest.approx(np.log(0.1 * 0.25))


def test_fewer_frames_than_states():
    assert best_durations(np.zeros((2, 3)), np.zeros((3, 4)), np.full(3, -1.0))[1] == -np.inf


def test_a_long_state_is_found_beyond_the_table():
    emission = np.stack([np.r_[np.zeros(400), np.full(5, -50.0)], np.r_[np.full(400, -50.0), np.zeros(5)]], axis=1)
    lasted, _ = best_durations(emission, np.full((2, 10), np.log(0.1)), np.full(2, np.log(0.99)))
    assert lasted.tolist() == [400, 5]
