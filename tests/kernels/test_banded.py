import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kernels.conftest import load_numba
from lipmotion.kernels.banded import build_equations, pin, solve, solve_mlpg
from oracles.statistics import generate_trajectory

SEEDS = st.integers(0, 2**32 - 1)
LENGTHS = st.integers(1, 24)


def statistics(seed: int, frames: int, channels: int = 2) -> tuple[np.ndarray, np.ndarray]:
    draw = np.random.default_rng(seed)
    return draw.normal(0, 1, (frames, 3, channels)), draw.uniform(0.1, 30, (frames, 3, channels))


def dense(mean, precision, pins=()) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return trajectory and variance of every channel; pins are (frame, channel, value)."""
    return [
        generate_trajectory(mean[:, :, c], precision[:, :, c], [(t, v) for t, channel, v in pins if channel == c])
        for c in range(mean.shape[2])
    ]


@given(seed=SEEDS, frames=LENGTHS)
@settings(max_examples=30)
def test_agrees_with_the_dense_system(seed, frames):
    mean, precision = statistics(seed, frames)
    values, variance = solve(build_equations(mean, precision))
    for channel, (wanted, spread) in enumerate(dense(mean, precision)):
        assert values[:, channel] == pytest.approx(wanted, abs=1e-10)
        assert variance[:, channel] == pytest.approx(spread, abs=1e-10)


@given(seed=SEEDS, frames=st.integers(1, 16), data=st.data())
@settings(max_examples=30)
def test_pins_agree_with_elimination(seed, frames, data):
    mean, precision = statistics(seed, frames)
    where = data.draw(st.sets(st.tuples(st.integers(0, frames - 1), st.integers(0, 1))))
    pins = [(t, c, float(np.sin(7 * t + c))) for t, c in data.draw(st.permutations(sorted(where)))]
    bands = build_equations(mean, precision)
    for t, c, value in pins:
        pin(bands, t, c, value)
    values, variance = solve(bands)
    for channel, (wanted, spread) in enumerate(dense(mean, precision, pins)):
        free = [t for t in range(frames) if (t, channel) not in where]
        assert values[:, channel] == pytest.approx(wanted, abs=1e-10)
        assert variance[free, channel] == pytest.approx(spread[free], abs=1e-10)
    assert all(values[t, c] == value for t, c, value in pins)


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
