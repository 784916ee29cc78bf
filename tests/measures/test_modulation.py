import numpy as np
import pytest

from lipmotion.measures.curves import modulation_distance_db

TIME_S = np.arange(200) / 25
WAVES = np.stack([np.sin(2 * np.pi * 3 * TIME_S), np.sin(2 * np.pi * 7 * TIME_S)], axis=1)


def test_half_the_movement_is_six_decibels_at_every_frequency_whatever_moves_when() -> None:
    noise = np.random.default_rng(0).normal(size=(200, 1))
    assert modulation_distance_db([noise / 2], [noise], 25.0) == pytest.approx([20 * np.log10(2)])
    assert modulation_distance_db([noise[::-1]], [noise], 25.0) == pytest.approx([0.0], abs=1.0)


def test_movement_at_another_frequency_is_far_away() -> None:
    assert (modulation_distance_db([WAVES[:, ::-1]], [WAVES], 25.0) > 10).all()
    faster = WAVES[:, :1] + 0.2 * np.sin(2 * np.pi * 30 * np.arange(800) / 100)[::4, None]
    assert modulation_distance_db([faster], [WAVES[:, :1]], 25.0) > 1


def test_a_channel_that_does_not_move_has_no_distance_and_one_that_should_move_a_finite_one() -> None:
    flat = np.zeros((200, 1))
    assert np.isnan(modulation_distance_db([WAVES[:, :1]], [flat], 25.0)).all()
    assert 20 < modulation_distance_db([flat], [WAVES[:, :1]], 25.0)[0] < 60


def test_frequencies_above_speech_do_not_count() -> None:
    time_s = np.arange(800) / 100
    slow = np.random.default_rng(0).normal(size=(80, 1)).repeat(10, axis=0)
    nervous = slow + np.sin(2 * np.pi * 40 * time_s)[:, None]
    assert modulation_distance_db([nervous], [slow], 100.0) == pytest.approx([0.0], abs=0.1)
