"""The solver finds what a slow, exact one finds, and smooths in time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from lipmotion.errors import InputError
from lipmotion.meshes.fitting.shape_weights import CurveCosts, fit_bounded_curves


def test_each_frame_is_the_bounded_least_squares_solution():
    rng = np.random.default_rng(0)
    matrix, targets = rng.normal(size=(6, 20)), 2 * rng.normal(size=(5, 20))
    found = fit_bounded_curves(matrix, targets, CurveCosts(ridge=1e-2, smooth=0.0))
    rows = np.concatenate([matrix.T, np.sqrt(1e-2) * np.eye(6)])
    for frame, target in zip(found, targets, strict=True):
        exact = lsq_linear(rows, np.concatenate([target, np.zeros(6)]), (0, 1), tol=1e-12).x
        np.testing.assert_allclose(frame, exact, atol=1e-4)


def test_all_frames_together_are_the_exact_solution():
    rng = np.random.default_rng(9)
    frames, matrix = 7, rng.normal(size=(3, 8))
    targets = rng.normal(size=(frames, 8))
    found = fit_bounded_curves(matrix, targets, CurveCosts(ridge=1e-2, smooth=0.7), np.array([[0.3, -0.3, 0.0]]))
    second = np.zeros((frames - 2, frames))
    for row in range(frames - 2):
        second[row, row : row + 3] = 1, -2, 1
    rows = np.concatenate(
        [
            np.kron(np.eye(frames), matrix.T),
            np.sqrt(1e-2) * np.eye(3 * frames),
            np.kron(np.eye(frames), [[0.3, -0.3, 0.0]]),
            np.sqrt(0.7) * np.kron(second, np.eye(3)),
        ]
    )
    wanted = np.concatenate([targets.reshape(-1), np.zeros(len(rows) - targets.size)])
    exact = lsq_linear(rows, wanted, (0, 1), tol=1e-12).x.reshape(frames, 3)
    np.testing.assert_allclose(found, exact, atol=1e-4)


def test_more_cost_is_smoother():
    targets = np.random.default_rng(2).random((50, 4))
    rough, smooth = (
        np.abs(np.diff(fit_bounded_curves(np.eye(4), targets, CurveCosts(smooth=cost)), axis=0)).sum()
        for cost in (0.0, 5.0)
    )
    assert smooth < rough / 2


def test_what_does_not_fit_is_refused():
    with pytest.raises(InputError, match="do not fit"):
        fit_bounded_curves(np.zeros((2, 3)), np.zeros((5, 4)))
    with pytest.raises(InputError, match="not finite"):
        fit_bounded_curves(np.full((2, 3), np.nan), np.zeros((5, 3)))
