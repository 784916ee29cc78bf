import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kernels.conftest import load_numba
from lipmotion.kernels.banded import normal_equations, pin, solve, solve_mlpg
from oracles import trajectories

SEEDS = st.integers(0, 2**32 - 1)
LENGTHS = st.integers(1, 24)


def statistics(seed: int, frames: int, channels: int = 2) -> tuple[np.ndarray, np.ndarray]:
    draw = np.random.default_rng(seed)
    return draw.normal(0, 1, (frames, 3, channels)), draw.uniform(0.1, 30, (frames, 3, channels))


def dense(mean, precision, pins=()) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return trajectory and variance of every channel; pins are (frame, channel, value)."""
    return [
        trajectories.generate(mean[:, :, c], precision[:, :, c], [(t, v) for t, channel, v in pins if channel == c])
        for c in range(mean.shape[2])
    ]


@given(seed=SEEDS, frames=LENGTHS)
@settings(max_examples=30)
def test_agrees_with_the_dense_system(seed, frames):
    mean, precision = statistics(seed, frames)
    values, variance = solve(normal_equations(mean, precision))
    for channel, (wanted, spread) in enumerate(dense(mean, precision)):
        assert values[:, channel] == pytest.approx(wanted, abs=1e-10)
        assert variance[:, channel] == pytest.approx(spread, abs=1e-10)


@given(seed=SEEDS, frames=st.integers(1, 16), data=st.data())
@settings(max_examples=30)
def test_pins_agree_with_elimination(seed, frames, data):
    mean, precision = statistics(seed, frames)
    where = data.draw(st.sets(st.tuples(st.integers(0, frames - 1), st.integers(0, 1))))
    pins = [(t, c, float(np.sin(7 * t + c))) for t, c in data.draw(st.permutations(sorted(where)))]
    bands = normal_equations(mean, precision)
    for t, c, value in pins:
        pin(bands, t, c, value)
    values, variance = solve(bands)
    for channel, (wanted, spread) in enumerate(dense(mean, precision, pins)):
        free = [t for t in range(frames) if (t, channel) not in where]
        assert values[:, channel] == pytest.approx(wanted, abs=1e-10)
        assert variance[free, channel] == pytest.approx(spread[free], abs=1e-10)
    assert all(values[t, c] == value for t, c, value in pins)


def test_pins_at_the_ends_and_side_by_side_are_exact():
    for frames in ((0, 1, 2), (5, 4), (8, 7, 6), tuple(range(9))):
        mean, precision = statistics(11, 9)
        pins = [(t, 1, 0.5 - 0.1 * t) for t in frames]
        bands = normal_equations(mean, precision)
        for t, channel, value in pins:
            pin(bands, t, channel, value)
        values, _ = solve(bands)
        assert [values[t, 1] for t in frames] == [value for _, _, value in pins]
        assert values[:, 1] == pytest.approx(dense(mean, precision, pins)[1][0], abs=1e-10)
        unpinned, _ = dense(mean, precision)[0]  # the other channel does not change
        assert values[:, 0] == pytest.approx(unpinned, abs=1e-10)
        values, variance = solve_mlpg(mean, precision, {(t, 1): value for t, _, value in pins})
        assert not variance[list(frames), 1].any()
        assert (np.delete(variance[:, 1], frames) > 0).all()


@given(seed=SEEDS, frames=LENGTHS)
@settings(max_examples=25)
def test_static_windows_alone_generate_the_means(seed, frames):
    mean, precision = statistics(seed, frames)
    precision[:, 1:] = 0
    values, variance = solve(normal_equations(mean, precision))
    assert values == pytest.approx(mean[:, 0], abs=1e-12)
    assert variance == pytest.approx(1 / precision[:, 0], rel=1e-12)


@given(seed=SEEDS, frames=st.integers(3, 24))
@settings(max_examples=25)
def test_means_of_a_real_curve_generate_that_curve(seed, frames):
    curve = np.random.default_rng(seed).normal(0, 1, frames)
    mean = (trajectories.window_matrix(frames) @ curve).reshape(3, frames).T[:, :, None]
    values, _ = solve(normal_equations(mean, statistics(seed, frames, 1)[1]))
    assert values[:, 0] == pytest.approx(curve, abs=1e-10)


def test_what_sticks_out_at_the_ends_counts_for_nothing():
    mean, precision = statistics(4, 8)
    other = mean.copy()
    other[[0, -1], 1:] = 1e6
    assert np.array_equal(solve(normal_equations(mean, precision))[0], solve(normal_equations(other, precision))[0])


def forms(monkeypatch, compute) -> list:
    """Return the results of NumPy and of the compiled form."""
    results = []
    for compiled in (False, True):
        load_numba(monkeypatch, compiled)
        results.append(compute())
    return results


@pytest.mark.parametrize(("frames", "channels"), [(1, 1), (2, 7), (3, 2), (5, 1), (60, 33)])
def test_the_compiled_form_gives_the_same_bits(frames, channels, monkeypatch):
    mean, precision = statistics(frames, frames, channels)
    plain, fast = forms(monkeypatch, lambda: solve_mlpg(mean, precision))
    assert np.array_equal(plain, fast)
    pins = {(frames // 2, 0): 0.5, (frames - 1, channels - 1): -1.0}
    plain, fast = forms(monkeypatch, lambda: solve_mlpg(mean, precision, pins))
    assert np.array_equal(plain, fast)


@pytest.mark.parametrize("shape", [(0, 1), (0, 3), (5, 0)])
def test_solutions_have_the_shape_of_the_system_where_there_is_nothing_in_it(shape):
    values, variance = solve(tuple(np.ones(shape) for _ in range(4)))
    assert values.shape == variance.shape == shape
