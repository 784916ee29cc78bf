import numpy as np
import pytest

from lipmotion.articulation.liveliness import (
    GAZE_COUNTER_SHARE,
    LARGEST_GLANCE,
    compute_liveliness,
    find_phrases,
    lid_closure,
)
from lipmotion.types import Channel, Motion, Prosody, Span, Timeline, Unit

MINUTE = Motion(np.full((6001, 1), 0.05), 100.0, (Channel("opening"),))
PHRASE = ((0, 3, "aa"), (3, 4, "sil"))
SAID = Timeline(
    tuple(Span(4.0 * n + start, 4.0 * n + end, Unit(phone)) for n in range(15) for start, end, phone in PHRASE)
)


SILENT = Timeline((Span(0.0, 60.0, Unit("sil")),))


def frames(fps: float, end_s: float = 60.0) -> np.ndarray:
    return np.arange(int(end_s * fps) + 1) / fps


def closings(lids: np.ndarray) -> np.ndarray:
    return np.flatnonzero(np.diff((lids > 0.5).astype(int)) == 1)


def test_eyes_blink_as_people_do_and_are_open_otherwise():
    for seed in range(3):
        lids = compute_liveliness(frames(100), MINUTE, SAID, None, seed=seed).lids
        blinks = closings(lids) / 100
        assert 9 <= len(blinks) <= 30
        assert np.diff(blinks).min() > 0.3
        assert (lids == 0).mean() > 0.85
        assert lids.max() == pytest.approx(1, abs=0.02)


def test_every_blink_is_seen_at_25_frames_a_second():
    time_s = frames(25)
    for begin in np.arange(0.5, 1.5, 0.013):
        assert lid_closure(time_s, [begin]).max() > 0.85


def test_blinks_prefer_the_ends_of_phrases():
    ends = np.array([end for _, end in find_phrases(SAID)])
    lids = (compute_liveliness(frames(100), MINUTE, SAID, None, seed=seed).lids for seed in range(10))
    near = [np.abs(ends - blink / 100).min() < 0.2 for each in lids for blink in closings(each)]
    assert np.mean(near) > 0.25  # 0.4 of every 4 s: 0.1 by chance


CURVES = ("lids", "brows", "gaze", "turn")


def test_nothing_depends_on_the_frame_rate():
    slow, fast = (compute_liveliness(frames(fps, 20), MINUTE, SAID, None) for fps in (25, 50))
    for name in CURVES:
        assert getattr(slow, name) == pytest.approx(getattr(fast, name)[::2])


def test_a_seed_gives_the_same_and_another_seed_something_else():
    first, same, other = (compute_liveliness(frames(25), MINUTE, SAID, None, seed=seed) for seed in (1, 1, 2))
    for name in CURVES:
        assert np.array_equal(getattr(first, name), getattr(same, name))
        assert np.abs(getattr(first, name) - getattr(other, name)).max() > 0


@pytest.mark.parametrize(("part", "curve"), [("blinks", "lids"), ("brows", "brows"), ("head", "turn")])
def test_each_part_can_be_off_and_leaves_the_others(part, curve):
    whole, without = (compute_liveliness(frames(25), MINUTE, SAID, None, **{part: on}) for on in (True, False))
    for name in CURVES:
        one, other = getattr(whole, name), getattr(without, name)
        if name == curve:
            assert np.ptp(other) < 1e-9
            assert np.ptp(one) > 3e-4
        elif not (part == "head" and name == "gaze"):
            assert np.array_equal(one, other)


def test_without_glances_the_eyes_hold_their_target_while_the_head_turns():
    moved = compute_liveliness(frames(25), MINUTE, SAID, None, gaze=False)
    assert moved.gaze == pytest.approx(-GAZE_COUNTER_SHARE * moved.turn[:, :2])
    assert np.ptp(moved.gaze) > 0.01


def test_loud_and_high_moments_raise_the_brows_and_nod_the_head():
    time_s = frames(100)
    accent = (time_s % 2.0 > 0.9) & (time_s % 2.0 < 1.2)
    voice = Prosody(-30 + 20.0 * accent, 4.94 + 0.45 * accent)
    moved = compute_liveliness(time_s, MINUTE, SAID, voice)
    flat = compute_liveliness(time_s, MINUTE, SAID, Prosody(np.full(6001, -30.0), np.full(6001, 4.94)))
    brows, nods = (moved.brows, flat.brows, -15), (-moved.turn[:, 1], -flat.turn[:, 1], 5)
    for one, other, later in (brows, nods):
        difference, soon = one - other, np.roll(accent, later)
        assert difference[soon].mean() > difference[~soon].mean() + 0.005


def test_glances_are_steps_between_rests_and_of_limited_size():
    time_s = frames(100)
    moved = compute_liveliness(time_s, MINUTE, SAID, None, head=False)
    assert np.abs(moved.gaze[:, 0]).max() <= LARGEST_GLANCE[0]
    assert np.abs(moved.gaze[:, 0]).max() > 0.08
    assert (np.abs(np.diff(moved.gaze[:, 0])) < 1e-6).mean() > 0.8


def test_brows_are_level_at_rest_and_never_below():
    brows = compute_liveliness(frames(25), MINUTE, SILENT, Prosody(np.full(6001, -30.0), np.full(6001, np.nan))).brows
    assert brows.min() >= 0
    assert brows.max() < 0.01


def test_the_head_moves_slowly_and_less_in_silence():
    turn, silent = (compute_liveliness(frames(100), MINUTE, units, None).turn for units in (SAID, SILENT))
    assert np.abs(np.diff(turn, axis=0)).max() * 100 < 0.8  # radians a second
    assert 0.01 < turn.std(axis=0).max() < 0.08
    assert np.abs(turn).max() < 0.25
    assert 0 < silent.std(axis=0).max() < 0.7 * turn.std(axis=0).max()


def test_without_time_and_phones_nothing_fails():
    nothing = Motion(np.zeros((1, 1)), 100.0, (Channel("opening"),))
    moved = compute_liveliness(np.zeros(1), nothing, Timeline(()), None)
    assert len(moved.lids) == len(moved.turn) == 1
