import numpy as np
import pytest

from lipmotion.faces.portrait.eyes import lid_closure


def test_eyes_blink_a_few_times_a_minute_and_are_open_otherwise():
    shut = lid_closure(np.arange(0, 60, 0.01))
    blinks = np.flatnonzero(np.diff((shut > 0.5).astype(int)) == 1) / 100
    assert 10 <= len(blinks) <= 25
    assert 2.5 < np.diff(blinks).min() < np.diff(blinks).max() < 5
    assert (shut == 0).mean() > 0.9
    assert shut.min() == 0
    assert shut.max() == pytest.approx(1, abs=0.01)


def test_a_blink_does_not_depend_on_the_frame_rate():
    slow, fast = lid_closure(np.arange(100) / 25), lid_closure(np.arange(200) / 50)
    assert slow == pytest.approx(fast[::2])


def test_every_blink_is_seen_at_25_frames_a_second():
    shut = lid_closure(np.arange(1500) / 25)
    starts = np.flatnonzero(np.diff((shut > 0).astype(int)) == 1)
    assert all(shut[start : start + 7].max() > 0.8 for start in starts)


def test_no_time_no_blink():
    assert len(lid_closure(np.zeros(0))) == 0
