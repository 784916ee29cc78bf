import numpy as np
import pytest

from lipmotion.faces.liveliness import accent_of, liveliness
from lipmotion.types import Prosody

FPS = 50.0
TIME_S = np.arange(0, 60, 1 / FPS)
OPENING = 0.08 * (1 + np.sin(2 * np.pi * 3 * TIME_S))
PAUSE = (np.sin(2 * np.pi * TIME_S / 6) > 0.8).astype(float)


@pytest.fixture(scope="module")
def minute():
    return liveliness(OPENING, PAUSE, FPS)


def blinks(shut) -> np.ndarray:
    return TIME_S[1:][(shut[1:] > 0.5) & (shut[:-1] <= 0.5)]


def test_the_same_seed_gives_the_same_movements_and_another_one_others(minute):
    again, other = liveliness(OPENING, PAUSE, FPS), liveliness(OPENING, PAUSE, FPS, seed=3)
    assert all(np.array_equal(a, b) for a, b in zip(minute, again, strict=True))
    assert not np.array_equal(minute.turn, other.turn)


def test_people_blink_ten_to_thirty_times_a_minute_and_open_their_eyes_again(minute):
    times_s = blinks(minute.shut)
    assert 10 <= len(times_s) <= 30
    assert np.diff(times_s).min() > 0.5
    assert minute.shut.min() == 0
    assert minute.shut.max() > 0.98
    assert (minute.shut > 0.5).mean() < 0.1


def test_the_head_moves_a_little_and_never_jumps(minute):
    assert 0.01 < minute.turn.std(axis=0).max() < 0.08
    assert np.abs(minute.turn).max() < 0.25
    assert np.abs(np.diff(minute.turn, axis=0)).max() * FPS < 0.8  # radians a second


def test_the_eyes_mostly_look_at_the_viewer_though_the_head_turns(minute):
    aim = minute.gaze + minute.turn[:, :2]
    assert (np.linalg.norm(aim, axis=1) < 0.08).mean() > 0.6
    assert np.abs(aim).max() < 0.3


def test_eyes_jump_and_hold(minute):
    """Between two jumps the eyes hold their target: most frames change by less than the head turns."""
    aim = minute.gaze + 0.85 * minute.turn[:, :2]
    steps = np.linalg.norm(np.diff(aim, axis=0), axis=1)
    assert (steps < 1e-9).mean() > 0.8
    assert steps.max() > 0.02


def test_the_shortest_motions_have_movements():
    for count in (1, 2, 5):
        alive = liveliness(np.zeros(count), np.zeros(count), 25.0)
        assert alive.shut.shape == alive.brows.shape == (count,)
        assert alive.gaze.shape == (count, 2)
        assert alive.turn.shape == (count, 3)


def test_a_loud_high_moment_is_an_accent_and_a_high_whisper_is_none():
    level_db, pitch = np.full(300, -30.0), np.full(300, np.log(120.0))
    level_db[100:140], pitch[100:140] = -10.0, np.log(200.0)
    level_db[200:240], pitch[200:240] = -70.0, np.log(200.0)
    accent = accent_of(Prosody(level_db, pitch), np.arange(300) / 100)
    assert accent is not None
    assert accent[120] > 0.9
    assert np.abs(accent[[20, 220]]).max() < 1e-9
    assert accent_of(None, TIME_S) is None
