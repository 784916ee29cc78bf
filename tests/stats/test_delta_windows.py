import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lipmotion.stats.delta_windows import with_dynamics
from oracles.trajectories import window_matrix


@given(frames=st.integers(1, 12), seed=st.integers(0, 1000))
def test_agrees_with_the_window_matrix(frames, seed):
    values = np.random.default_rng(seed).normal(0, 1, (frames, 2))
    wanted = (window_matrix(frames) @ values).reshape(3, frames, 2)
    assert with_dynamics(values) == pytest.approx(wanted.swapaxes(0, 1), abs=1e-12)


def test_a_parabola_has_its_slope_and_constant_curvature():
    t = np.arange(6.0)[:, None]
    dynamics = with_dynamics(3 * t * t - 5 * t + 1)
    assert dynamics[1:-1, 1] == pytest.approx(6 * t[1:-1] - 5)
    assert dynamics[1:-1, 2] == pytest.approx(np.full((4, 1), 6.0))
    assert not dynamics[[0, -1], 1:].any()
