import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lipmotion.stats.curves import measure_modulation_spectrum, varies, with_dynamics
from oracles.statistics import window_matrix


@given(frames=st.integers(1, 12), seed=st.integers(0, 1000))
def test_agrees_with_the_window_matrix(frames, seed):
    values = np.random.default_rng(seed).normal(0, 1, (frames, 2))
    wanted = (window_matrix(frames) @ values).reshape(3, frames, 2)
    assert with_dynamics(values) == pytest.approx(wanted.swapaxes(0, 1), abs=1e-12)


def rounded(value: float, seed: int = 0) -> np.ndarray:
    """Return a constant with the rounding errors of another processor."""
    return value * (1 + 1e-7 * np.random.default_rng(seed).uniform(-1, 1, size=(500, 1)))


def test_rounding_of_a_constant_is_no_movement() -> None:
    for value in (0.0, 1e-30, 0.3, -7.0, 1e6):
        assert not varies(rounded(value)).any()
    values = np.concatenate([rounded(1e6), np.linspace(0, 1e-3, 500)[:, None], rounded(0.0)], axis=1)
    assert varies(values).tolist() == [False, True, False]  # columns are judged apart


@pytest.mark.parametrize("rate_hz", [25.0, 100.0])
def test_a_wave_is_at_its_frequency(rate_hz: float) -> None:
    time_s = np.arange(round(4 * rate_hz)) / rate_hz
    frequencies, power = measure_modulation_spectrum([5 + np.sin(2 * np.pi * 6.25 * time_s)[:, None]], rate_hz)
    assert frequencies[power[:, 0].argmax()] == pytest.approx(6.25)
    assert frequencies[-1] == pytest.approx(rate_hz / 2)
    near = abs(frequencies - 6.25) < 2
    assert power[near].sum() > 0.999 * power.sum()


def test_it_is_the_mean_over_windows_and_level_does_not_matter() -> None:
    rng = np.random.default_rng(0)
    clips = [rng.normal(size=(32, 2)) for _ in range(3)]

    def power(*given: np.ndarray) -> np.ndarray:
        return measure_modulation_spectrum(given, 25.0)[1]

    assert power(*clips) == pytest.approx(np.mean([power(clip + 9) for clip in clips], axis=0))
    assert power(2 * clips[0]) == pytest.approx(4 * power(clips[0]))
    short = power(np.arange(4.0)[:, None])
    assert short.shape == (len(power(clips[0])), 1)  # a short clip has as many frequencies
    assert np.isfinite(short).all()
