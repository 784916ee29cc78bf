import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.measures.curves import bootstrap_interval, mean_distance, pooled_correlation


def acc(generated, original) -> float:
    return float(pooled_correlation(generated, original)[0])


def clips(seed: int, count: int = 12):
    draw = np.random.default_rng(seed)
    original = [draw.normal(0, 1, (40, 1)) for _ in range(count)]
    return [clip + draw.normal(0, 0.7, clip.shape) for clip in original], original


@given(seed=st.integers(0, 10_000))
@settings(max_examples=10)
def test_the_interval_holds_the_figure_itself(seed):
    generated, original = clips(seed)
    low, high = bootstrap_interval(acc, generated, original, seed=0, draws=200)
    assert low < acc(generated, original) < high
    assert high - low < 0.3


def test_clips_are_drawn_whole_and_together():
    """Every clip has its own value, generated and original alike, so clips that were drawn separately would differ."""
    values = [np.full((3, 1), float(n)) for n in range(5)]
    assert bootstrap_interval(mean_distance, values, values, seed=0, draws=50) == (0, 0)


def test_95_percent_of_the_draws_lie_inside():
    """The mean of 200 values is nearly normal: 1.96 standard errors to either side."""
    values = np.abs(np.random.default_rng(4).normal(5, 1, 200))
    generated, original = [np.full((1, 1), value) for value in values], [np.zeros((1, 1))] * 200
    low, high = bootstrap_interval(mean_distance, generated, original, seed=0)
    assert (low + high) / 2 == pytest.approx(values.mean(), abs=0.02)
    assert high - low == pytest.approx(2 * 1.96 * values.std() / np.sqrt(200), rel=0.07)
