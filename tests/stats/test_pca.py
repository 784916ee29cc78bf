import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.stats.pca import fit_pca

SEEDS = st.integers(0, 2**32 - 1)


def cloud(seed: int, count: int = 40, dimensions: int = 5) -> np.ndarray:
    draw = np.random.default_rng(seed)
    return draw.normal(3, 1, (count, dimensions)) @ draw.normal(0, 1, (dimensions, dimensions))


@given(seed=SEEDS)
@settings(deadline=None, max_examples=25)
def test_all_components_restore_everything(seed):
    values = cloud(seed)
    pca = fit_pca(values, 5)
    assert pca.restore(pca.project(values)) == pytest.approx(values, abs=1e-9)
    assert pca.project(pca.restore(values)) == pytest.approx(values, abs=1e-9)


@given(seed=SEEDS, components=st.integers(1, 5))
@settings(deadline=None, max_examples=25)
def test_explained_variance_is_that_of_the_covariance(seed, components):
    values = cloud(seed)
    pca = fit_pca(values, components)
    largest = np.linalg.eigvalsh(np.cov(values.T, bias=True))[::-1][:components]
    projected = pca.project(values)
    assert projected.var(axis=0) == pytest.approx(largest, rel=1e-6, abs=1e-9)
    assert projected.mean(axis=0) == pytest.approx(np.zeros(components), abs=1e-9)
    assert pca.basis @ pca.basis.T == pytest.approx(np.eye(components), abs=1e-10)


def test_never_more_components_than_dimensions():
    assert fit_pca(cloud(1), 99).basis.shape == (5, 5)


def test_a_line_is_one_component():
    line = np.outer(np.linspace(-1, 1, 9), [3.0, 0.0, 4.0]) + np.array([1, 2, 3])
    pca = fit_pca(line, 1)
    assert pca.basis[0] == pytest.approx([0.6, 0, 0.8])  # the sign too: the largest entry is positive
    assert pca.restore(pca.project(line)) == pytest.approx(line)
