from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.stats.constrained_mllr import (
    collect_transform_statistics,
    create_prior,
    identity,
    improve_transform,
    log_determinant,
    transform_features,
)
from lipmotion.stats.mixture import Mixtures
from oracles import statistics as oracle
from oracles.statistics import random_mixtures

SIZE = 3
SHAPE = 4, 2, SIZE
ALL = np.ones((SIZE, SIZE + 1), bool)


def spoken(draw: np.random.Generator, mixtures: Mixtures, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Return features drawn from the mixtures, and the density of each frame."""
    densities = draw.integers(0, mixtures.size[0], frames)
    weights = np.exp(mixtures.log_weights.astype(float))
    chosen = np.array([draw.choice(mixtures.size[1], p=weights[d] / weights[d].sum()) for d in densities], int)
    noise = draw.normal(size=(frames, mixtures.size[2]))
    features = mixtures.means[densities, chosen] + noise * np.sqrt(mixtures.variances[densities, chosen])
    return features.astype(np.float32), densities


def random_transform(draw: np.random.Generator, size: int = SIZE) -> np.ndarray:
    return identity(size) + draw.normal(0, 0.3, (size, size + 1))


def gradient(function: Callable[[np.ndarray], float], transform: np.ndarray, step: float = 1e-5) -> np.ndarray:
    slope = np.zeros(transform.shape)
    for place in np.ndindex(*transform.shape):
        moved = np.zeros(transform.shape)
        moved[place] = step
        slope[place] = (function(transform + moved) - function(transform - moved)) / (2 * step)
    return slope


def test_statistics_are_those_of_the_sums_written_out() -> None:
    for seed in range(3):
        draw = np.random.default_rng(seed)
        mixtures, transform = random_mixtures(draw, SHAPE), random_transform(draw)
        given = mixtures, *spoken(draw, mixtures, 20), transform
        found, log_likelihood = collect_transform_statistics(*given)
        quadratic, linear = oracle.affine_statistics(*given)
        assert found.count == 20
        np.testing.assert_allclose(found.quadratic, quadratic, rtol=1e-4, atol=1e-4)
        np.testing.assert_allclose(found.linear, linear, rtol=1e-4, atol=1e-4)
        assert log_likelihood == pytest.approx(oracle.affine_log_likelihood(*given), abs=1e-3)


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), frames=st.integers(0, 30))
def test_no_row_lowers_the_objective(seed: int, frames: int) -> None:
    draw = np.random.default_rng(seed)
    mixtures, transform = random_mixtures(draw, SHAPE), random_transform(draw)
    statistics, _ = collect_transform_statistics(mixtures, *spoken(draw, mixtures, frames), transform)
    statistics += create_prior(mixtures, np.arange(4)).times(5)
    values = [oracle.affine_objective(statistics, transform)]
    for _ in range(4):
        transform = improve_transform(transform, statistics, ALL, sweeps=1)
        values.append(oracle.affine_objective(statistics, transform))
    assert (np.diff(values) >= -1e-8 * np.abs(values[1:])).all()


def test_a_known_distortion_is_undone() -> None:
    draw = np.random.default_rng(1)
    mixtures = random_mixtures(draw, (8, 2, SIZE))
    clean, densities = spoken(draw, mixtures, 4000)
    distortion = random_transform(draw)
    features, transform = transform_features(clean, distortion), identity(SIZE)
    _, before = collect_transform_statistics(mixtures, features, densities, transform)
    for _ in range(30):
        statistics, _ = collect_transform_statistics(mixtures, features, densities, transform)
        transform = improve_transform(transform, statistics, ALL)
    restored = transform_features(features, transform)
    assert np.abs(restored - clean).mean() < 0.1 < np.abs(features - clean).mean()
    _, after = collect_transform_statistics(mixtures, features, densities, transform)
    assert after > before + 1000
    assert log_determinant(transform) == pytest.approx(-log_determinant(distortion), abs=0.1)


def test_entries_that_are_not_free_stay() -> None:
    draw = np.random.default_rng(3)
    mixtures, start = random_mixtures(draw, SHAPE), random_transform(draw)
    statistics, _ = collect_transform_statistics(mixtures, *spoken(draw, mixtures, 50), start)
    free = np.eye(SIZE, SIZE + 1, dtype=bool)
    free[:, -1] = True
    better = improve_transform(start, statistics, free)
    assert np.array_equal(better[~free], start[~free])
    assert oracle.affine_objective(statistics, better) > oracle.affine_objective(statistics, start)
    slope = gradient(
        partial(oracle.affine_objective, statistics), improve_transform(start, statistics, free, sweeps=60)
    )
    assert np.abs(slope[free]).max() < 1e-2 < np.abs(slope[~free]).max()
