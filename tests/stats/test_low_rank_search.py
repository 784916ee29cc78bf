from __future__ import annotations

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.stats.block_code import checked_ranges
from lipmotion.stats.low_rank_search import compress_table


def table(frames: int, columns: int, seed: int = 0) -> np.ndarray:
    draw = np.random.default_rng(seed)
    sources = np.sin(np.arange(frames)[:, None] / draw.uniform(5, 30, 4))
    return sources @ draw.normal(0, 1, (4, columns)) + draw.normal(0, 0.02, (frames, columns))


def excess_of(groups: np.ndarray, allowed: np.ndarray):
    def excess(restored: np.ndarray, true: np.ndarray) -> np.ndarray:
        squares = np.square((restored - true) / allowed)
        return np.sqrt(np.stack([squares[:, groups == g].sum(axis=1) for g in range(groups.max() + 1)], axis=1))

    return excess


def test_all_errors_are_about_what_is_allowed() -> None:
    """One column is noise, four times the others': without weights it would set the step of all."""
    values = table(1500, 20)
    values[:, 7] += np.random.default_rng(1).normal(0, 0.5, 1500)
    groups, allowed = np.arange(20), np.full(20, 0.05)
    coded = compress_table(values, checked_ranges(None, 1500), allowed, groups, excess_of(groups, allowed))
    errors = np.percentile(np.abs(coded.code.rows(np.arange(1500)) - values) / allowed, 99, axis=0)
    assert coded.error == pytest.approx(errors.max(), rel=1e-3)
    assert errors.max() <= 1 + 1e-6
    assert np.median(errors) > 0.8


def test_what_is_constant_but_for_what_is_allowed_takes_no_coefficients() -> None:
    values = 3 + 1e-3 * table(200, 5)
    groups, allowed = np.arange(5), np.full(5, 1.0)
    coded = compress_table(values, checked_ranges(None, 200), allowed, groups, excess_of(groups, allowed))
    assert coded.code.code.used.shape == (0, 2)
    assert coded.code.rows(np.arange(200)) == pytest.approx(values, abs=0.05)


def test_wide_tables_get_as_many_components_as_they_need() -> None:
    draw = np.random.default_rng(0)
    values = draw.normal(0, 1, (150, 80)) @ draw.normal(0, 1, (80, 300))
    groups, allowed = np.arange(300) // 3, np.full(300, 3.0)
    coded = compress_table(values, checked_ranges(None, 150), allowed, groups, excess_of(groups, allowed))
    assert 64 < len(coded.code.basis) <= 80
    assert coded.error <= 1


def test_errors_that_no_step_can_keep_are_refused() -> None:
    values, groups, allowed = table(100, 3), np.arange(3), np.ones(3)

    def always_wrong(restored: np.ndarray, _: np.ndarray) -> np.ndarray:
        return np.full((len(restored), 3), 2.0)

    with pytest.raises(InputError, match="cannot be promised for values from"):
        compress_table(values, checked_ranges(None, 100), allowed, groups, always_wrong)
