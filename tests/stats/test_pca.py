import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.stats import pca as module
from lipmotion.stats.pca import choose_evenly, fit_pca
from oracles.statistics import components, share

SEEDS = st.integers(0, 2**32 - 1)


def spectrum(seed: int, count: int, dimensions: int) -> np.ndarray:
    """Return values whose components have clearly different variances, with some noise."""
    draw = np.random.default_rng(seed)
    scores = draw.normal(0, 1, (count, 8)) * 10 * 0.7 ** np.arange(8)
    return scores @ draw.normal(0, 1, (8, dimensions)) + 0.01 * draw.normal(0, 1, (count, dimensions)) + 5


@pytest.mark.parametrize(("count", "dimensions"), [(60, 20), (20, 60), (40, 40)])
@given(seed=SEEDS)
@settings(max_examples=15)
def test_components_are_those_of_the_svd(count, dimensions, seed):
    values = spectrum(seed, count, dimensions)
    pca = fit_pca(values, 5)
    mean, basis = components(values, 5)
    assert pca.mean == pytest.approx(mean)
    np.testing.assert_allclose(pca.basis, basis, rtol=0, atol=1e-6, equal_nan=False)


@pytest.mark.long
@pytest.mark.parametrize(("count", "dimensions", "kind"), [(1600, 1550, np.float32), (1550, 1600, np.uint8)])
def test_a_large_table_is_searched_for_its_first_components(count, dimensions, kind):
    values = spectrum(3, count, dimensions)
    assert min(values.shape) > module.EXACT_ROWS
    values = (255 * (values - values.min()) / np.ptp(values)).astype(kind)
    pca = fit_pca(values, 5)
    assert pca.basis @ pca.basis.T == pytest.approx(np.eye(5), abs=1e-5)
    _, basis = components(values.astype(np.float32), 5)
    assert share(values, pca.basis) == pytest.approx(share(values, basis), rel=1e-4)
    assert pca.basis == pytest.approx(basis, abs=0.02)
    assert np.array_equal(fit_pca(values, 5).basis, pca.basis)


def test_places_are_spread_evenly():
    assert choose_evenly(4, 8).tolist() == [1, 3, 5, 7]
    assert choose_evenly(9, 3).tolist() == [0, 1, 2]
    assert choose_evenly(5, 0).tolist() == []
    chosen = choose_evenly(980, 33_000)
    assert (np.diff(chosen) > 30).all()
    assert (chosen[0], chosen[-1]) == (16, 32_983)


@pytest.mark.parametrize("count", [4, 60])
def test_directions_of_rounding_are_no_components(count):
    rng = np.random.default_rng(0)
    rounding = 1 + 1e-15 * rng.normal(size=(count, 7))
    plane = rng.normal(size=(count, 2)) @ rng.normal(size=(2, 7)) + 3
    for values, dimensions in ((plane, 2), (plane * rounding, 2), (0.1 * rounding, 0)):
        found = fit_pca(values, 7)
        assert found.basis.shape == (dimensions, 7)
        assert found.restore(found.project(values)) == pytest.approx(values)
