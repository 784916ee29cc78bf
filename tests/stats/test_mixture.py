import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from lipmotion.stats.mixture import SPLIT_STEP, Mixtures
from oracles.statistics import random_mixtures

SEEDS = st.integers(0, 2**32 - 1)
FLOOR = np.full(3, 1e-3, np.float32)


def made(seed: int, components: int = 2) -> Mixtures:
    return random_mixtures(np.random.default_rng(seed), (3, components, 3), 3.0, 2.0, (0.2, 3))


def random_data(seed: int, frames: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Return frames of two clusters, and the posterior of a density in each."""
    draw = np.random.default_rng([seed, 7])
    centres = draw.normal(0, 2, (2, 3))[draw.integers(2, size=frames)]
    return (centres + draw.normal(0, 0.7, (frames, 3))).astype(np.float32), draw.random(frames).astype(np.float32)


def em_update(mixtures: Mixtures, density: int, x: np.ndarray, share: np.ndarray, floor: np.ndarray) -> None:
    sums = mixtures.component_sums(density, x, share)
    mixtures.set_from_statistics(np.array([density]), sums[None], floor)


def component_logs(mixtures: Mixtures, density: int, x: np.ndarray) -> np.ndarray:
    """Return ``log_components`` computed by SciPy [shape=(T, M)]."""
    rows = zip(mixtures.log_weights[density], mixtures.means[density], mixtures.variances[density], strict=True)
    return np.stack([w + multivariate_normal(mean, np.diag(var)).logpdf(x) for w, mean, var in rows], axis=1)


@given(seed=SEEDS, components=st.sampled_from([1, 2, 4]))
@settings(max_examples=20)
def test_log_likelihood_is_that_of_scipy(seed, components):
    mixtures, (x, _) = made(seed, components=components), random_data(seed, 20)
    for density in range(3):
        wanted = component_logs(mixtures, density, x)
        assert mixtures.log_components(x)[:, density] == pytest.approx(wanted, abs=2e-3)
        assert mixtures.log_likelihood(x)[:, density] == pytest.approx(logsumexp(wanted, axis=1), abs=2e-3)


@given(seed=SEEDS)
@settings(max_examples=30)
def test_no_step_of_improvement_lowers_the_likelihood(seed):
    mixtures, (x, share) = made(seed), random_data(seed)
    before = -np.inf
    for _ in range(8):
        em_update(mixtures, 1, x, share, FLOOR)
        used = np.isfinite(mixtures.log_weights[1])
        after = share @ logsumexp(component_logs(mixtures, 1, x), axis=1)
        if used.all():  # switching a component off is no step of EM
            assert after >= before - 1e-2  # single precision, 200 frames
        before = after


def test_one_gaussian_takes_the_weighted_mean_and_variance_above_the_floor():
    mixtures, (x, share) = made(2, components=1), random_data(2)
    untouched = mixtures.copy()
    em_update(mixtures, 1, x, share, FLOOR)
    mean = np.average(x, axis=0, weights=share)
    assert mixtures.means[1, 0] == pytest.approx(mean, abs=1e-4)
    assert mixtures.variances[1, 0] == pytest.approx(np.average((x - mean) ** 2, axis=0, weights=share), abs=1e-3)
    assert mixtures.log_weights[1] == pytest.approx(0, abs=1e-6)
    assert np.array_equal(mixtures.means[[0, 2]], untouched.means[[0, 2]])
    floor = np.array([0.1, 0.2, 0.3], np.float32)
    em_update(mixtures, 0, np.ones((50, 3), np.float32), np.ones(50, np.float32), floor)
    assert mixtures.variances[0, 0] == pytest.approx(floor)


def test_tiny_relevance_follows_the_data_and_relevance_counts_as_frames():
    mixtures, (x, share) = made(4, components=1), random_data(4)
    mixtures.variances[2] = 1  # the prior's variance bounds what adaptation may reach from below
    mixtures.map_update(0, mixtures.component_sums(0, x, share), prior=2, relevance=1e-6)
    mean = np.average(x, axis=0, weights=share)
    variance = np.average((x - mean) ** 2, axis=0, weights=share)
    assert mixtures.means[0, 0] == pytest.approx(mean, abs=1e-3)
    assert mixtures.variances[0, 0] == pytest.approx(np.maximum(variance, 0.25), rel=1e-2)
    prior = mixtures.means[1, 0].astype(float)
    sums = mixtures.component_sums(0, np.full((30, 3), 2.0, np.float32), np.ones(30, np.float32))
    mixtures.map_update(0, sums, prior=1, relevance=10.0)
    assert mixtures.means[0, 0] == pytest.approx((10 * prior + 30 * 2) / 40, abs=1e-5)


@given(seed=SEEDS, components=st.sampled_from([1, 2]))
@settings(max_examples=20)
def test_splitting_keeps_the_density_nearly_the_same(seed, components):
    mixtures, (x, _) = made(seed, components=components), random_data(seed, 50)
    split = mixtures.split()
    assert split.size == (3, 2 * components, 3)
    assert np.exp(split.log_weights).sum(axis=1) == pytest.approx(np.ones(3), abs=1e-5)
    assert split.means.reshape(3, 2, components, 3).mean(axis=1) == pytest.approx(mixtures.means, abs=1e-5)
    change = split.log_likelihood(x) - mixtures.log_likelihood(x)
    z = ((x[:, None, None] - mixtures.means) / np.sqrt(mixtures.variances)).sum(axis=3)
    wanted = np.log(np.cosh(SPLIT_STEP * z)) - 3 * SPLIT_STEP**2 / 2  # of each component
    assert (change > wanted.min(axis=2) - 5e-3).all()
    assert (change < wanted.max(axis=2) + 5e-3).all()
    assert wanted[np.abs(z) < 2].max(initial=0) < 0.1


def test_a_component_with_less_than_two_frames_of_data_is_switched_off():
    mixtures, (x, _) = made(3), random_data(3)
    size = mixtures.means.shape[2]
    for frames, is_off in ((1.0, True), (1.9, True), (2.1, False)):
        rows = [[1.0] * size + [4.0] * size + [count] for count in (50.0, frames)]
        mixtures.set_from_statistics(np.array([0]), np.array([rows]), FLOOR)
        assert (mixtures.log_weights[0, 1] == -np.inf) == is_off
        assert (mixtures.variances[0, 1] == 1).all() == is_off
        assert np.isfinite(mixtures.log_likelihood(x)).all()
        assert np.isfinite(mixtures.split().log_likelihood(x)).all()
