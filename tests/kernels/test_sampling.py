from collections import Counter

import numpy as np
import pytest

from lipmotion.kernels.paths import NetworkArrays, sample_paths
from oracles.sampling import path_posterior

EMISSION = np.array([0, 1, 0, 2])
ARCS = {(0, 0): -0.5, (0, 1): -1.0, (1, 1): -0.7, (1, 2): -0.3, (2, 2): -1.2, (2, 3): -0.4, (3, 0): -0.6, (3, 3): -2.0}
INITIAL = np.array([-0.2, -np.inf, -1.5, -np.inf])
FINAL = np.array([-np.inf, -0.1, -0.9, -0.3])


def arrays():
    ordered = sorted((target, source, log) for (source, target), log in ARCS.items())
    targets = np.array([target for target, _, _ in ordered])
    return (
        EMISSION,
        np.array([source for _, source, _ in ordered]),
        np.array([log for _, _, log in ordered]),
        np.searchsorted(targets, np.arange(4)),
        INITIAL,
        FINAL,
    )


def test_paths_come_as_often_as_they_are_probable():
    log_emission = np.random.default_rng(0).normal(0, 1.2, (5, 3))
    expected, total = path_posterior(log_emission, EMISSION, ARCS, INITIAL, FINAL)
    count = 6_000
    paths, log_likelihood = sample_paths(
        log_emission, NetworkArrays(*arrays()), np.random.default_rng(1).random((count, 5))
    )
    assert log_likelihood == pytest.approx(total, abs=1e-9)
    found = Counter(map(tuple, paths.tolist()))
    assert set(found) <= set(expected)
    chi = sum((found[p] - count * q) ** 2 / (count * q) for p, q in expected.items() if count * q > 5)
    degrees = sum(count * q > 5 for q in expected.values())
    assert degrees > 5
    assert chi < degrees + 4 * np.sqrt(2 * degrees)


def test_what_is_far_from_probable_on_the_way_may_be_all_that_is_left():
    log_emission = np.zeros((4, 3))
    log_emission[0, 0] = log_emission[1, 1] = -5000.0
    paths, log_likelihood = sample_paths(log_emission, NetworkArrays(*arrays()), np.full((3, 4), 0.999))
    assert np.isfinite(log_likelihood)
    assert (paths >= 0).all()


def test_no_path():
    log_emission = np.zeros((3, 3))
    log_emission[1] = -np.inf
    with np.errstate(invalid="raise"):
        paths, log_likelihood = sample_paths(log_emission, NetworkArrays(*arrays()), np.zeros((2, 3)))
    assert log_likelihood == -np.inf
    assert (paths == -1).all()
