from __future__ import annotations

import numpy as np
import pytest

from lipmotion_faces.tracking.frames import frame_count, nearest_indices, nominal_rate_hz, resample_to_constant_rate


def test_the_stated_rate_is_believed_when_it_fits():
    rounded = np.round(np.arange(90) / 30, 3)  # 33, 33, 34 ms
    assert nominal_rate_hz(rounded, [30.0]) == 30.0
    assert nominal_rate_hz(np.delete(rounded, [4, 30, 31]), [30.0, 29.1]) == 30.0


def test_a_wrong_stated_rate_is_not_believed():
    assert nominal_rate_hz(np.arange(50) / 25, [1000.0]) == pytest.approx(25)
    assert nominal_rate_hz(np.arange(50) / 25, [1000.0, 24.9]) == 24.9
    assert nominal_rate_hz(np.arange(50) / 25, []) == pytest.approx(25)


def test_one_frame_has_the_stated_rate():
    assert nominal_rate_hz(np.zeros(1), [50.0]) == 50.0
    assert nominal_rate_hz(np.zeros(1), []) == 25.0


def test_counts_to_the_last_frame():
    assert frame_count(np.arange(75) / 25, 25.0) == 75
    assert frame_count(np.array([0, 0.033, 0.067, 2.967]), 30.0) == 90


def test_nearest_is_nearest():
    times_s, wanted_s = np.sort(np.random.default_rng(1).random(30)), np.linspace(-0.2, 1.2, 99)
    expected = np.abs(times_s[None] - wanted_s[:, None]).min(axis=1)
    np.testing.assert_array_equal(np.abs(times_s[nearest_indices(times_s, wanted_s)] - wanted_s), expected)
    assert nearest_indices(np.array([3.0]), wanted_s).tolist() == [0] * 99


def test_frames_in_their_place_stay_as_they_are():
    values = np.random.default_rng(2).normal(size=(50, 3))
    np.testing.assert_array_equal(resample_to_constant_rate(np.round(np.arange(50) / 30, 3), values, 30.0, 50), values)


def test_dropped_frames_are_found_again_by_their_time():
    times_s = np.arange(100) / 25
    curve = np.stack([np.sin(2 * np.pi * 1.5 * times_s), np.cos(2 * np.pi * times_s)], axis=1)
    kept = np.delete(np.arange(100), [7, 30, 31, 60, 80])
    result = resample_to_constant_rate(times_s[kept], curve[kept], 25.0, 100)
    np.testing.assert_array_equal(result[kept], curve[kept])
    np.testing.assert_allclose(result, curve, atol=0.02)


def test_jittered_frames_are_put_on_the_grid():
    rng = np.random.default_rng(3)
    times_s = np.sort(np.arange(100) / 25 + rng.uniform(-0.012, 0.012, 100))
    curve = np.sin(2 * np.pi * 1.5 * times_s)[:, None]
    inner = slice(2, 97)
    result = resample_to_constant_rate(times_s, curve, 25.0, 100)[inner, 0]
    np.testing.assert_allclose(result, np.sin(2 * np.pi * 1.5 * np.arange(100) / 25)[inner], atol=0.02)


def test_long_gaps_are_straight_and_ends_constant():
    values = np.random.default_rng(4).normal(size=(60, 2))
    kept = np.r_[5:20, 40:55]
    result = resample_to_constant_rate(kept / 25, values[kept], 25.0, 60)
    np.testing.assert_array_equal(result[:5], np.tile(values[5], (5, 1)))
    np.testing.assert_array_equal(result[55:], np.tile(values[54], (5, 1)))
    np.testing.assert_allclose(np.diff(result[19:41], n=2, axis=0), 0, atol=1e-12)


def test_a_few_frames_suffice():
    for count in (1, 2, 3):
        result = resample_to_constant_rate(np.arange(count) / 5, np.ones((count, 2)), 25.0, 12)
        np.testing.assert_allclose(result, 1)
