import numpy as np
import pytest

from lipmotion.faces.portrait.expression import LARGEST_GLANCE, RESTING_LIDS, expression, lid_closure, phrases
from lipmotion.types import Channel, Motion, Prosody, Span, Timeline, Unit

MINUTE = Motion(np.full((6001, 1), 0.05), 100.0, (Channel("opening"),))
PHRASE = ((0, 3, "aa"), (3, 4, "sil"))
SAID = Timeline(
    tuple(Span(4.0 * n + start, 4.0 * n + end, Unit(phone)) for n in range(15) for start, end, phone in PHRASE)
)


def frames(fps: float, end_s: float = 60.0) -> np.ndarray:
    return np.arange(int(end_s * fps) + 1) / fps


def closings(lids: np.ndarray) -> np.ndarray:
    return np.flatnonzero(np.diff((lids > 0.5).astype(int)) == 1)


def test_eyes_blink_as_people_do_and_are_open_otherwise():
    for seed in range(3):
        lids = expression(frames(100), MINUTE, SAID, None, seed=seed).lids
        blinks = closings(lids) / 100
        assert 9 <= len(blinks) <= 30
        assert np.diff(blinks).min() > 0.3
        assert (lids <= RESTING_LIDS).mean() > 0.85
        assert lids.max() == pytest.approx(1, abs=0.02)


def test_every_blink_is_seen_at_25_frames_a_second():
    time_s = frames(25)
    for begin in np.arange(0.5, 1.5, 0.013):
        assert lid_closure(time_s, [begin]).max() > 0.85


def test_blinks_prefer_the_ends_of_phrases():
    ends = np.array([end for _, end in phrases(SAID)])
    near = [
        np.abs(ends - blink / 100).min() < 0.2
        for seed in range(10)
        for blink in closings(expression(frames(100), MINUTE, SAID, None, seed=seed).lids)
    ]
    assert np.mean(near) > 0.25  # 0.4 of every 4 s: 0.1 by chance


def test_nothing_depends_on_the_frame_rate():
    slow, fast = (expression(frames(fps, 20), MINUTE, SAID, None) for fps in (25, 50))
    for one, other in zip(slow, fast, strict=True):
        assert one == pytest.approx(other[::2])


def test_a_seed_gives_the_same_and_another_seed_something_else():
    first, same, other = (expression(frames(25), MINUTE, SAID, None, seed=seed) for seed in (1, 1, 2))
    for one, two, three in zip(first, same, other, strict=True):
        assert np.array_equal(one, two)
        assert np.abs(one - three).max() > 0


PARTS = [("blinks", ["lids"]), ("gaze", ["gaze_x"]), ("brows", ["brows"]), ("head", ["head"])]


@pytest.mark.parametrize(("part", "curves"), PARTS)
def test_each_part_can_be_off_and_leaves_the_others(part, curves):
    whole = expression(frames(25), MINUTE, SAID, None)
    without = expression(frames(25), MINUTE, SAID, None, **{part: False})
    for name, one, other in zip(whole._fields, whole, without, strict=True):
        if name in curves or (part == "brows" and name == "worry"):
            assert np.ptp(other) < 1e-9
            assert np.ptp(one) > 3e-4
        elif not (part == "head" and name.startswith("gaze")) and not (part == "gaze" and name == "gaze_y"):
            assert np.array_equal(one, other)


def test_loud_and_high_moments_raise_the_brows_and_nod_the_head():
    time_s = frames(100)
    accent = (time_s % 2.0 > 0.9) & (time_s % 2.0 < 1.2)
    voice = Prosody(-30 + 20.0 * accent, 4.94 + 0.45 * accent)
    moved = expression(time_s, MINUTE, SAID, voice)
    flat = expression(time_s, MINUTE, SAID, Prosody(np.full(6001, -30.0), np.full(6001, 4.94)))
    soon = np.roll(accent, 5)
    for one, other in ((moved.brows, flat.brows), (moved.head[:, 4], flat.head[:, 4])):
        difference = one - other
        assert difference[soon].mean() > difference[~soon].mean() + 0.005


def test_glances_are_steps_between_rests_and_of_limited_size():
    time_s = frames(100)
    moved = expression(time_s, MINUTE, SAID, None, head=False)
    assert np.abs(moved.gaze_x).max() <= LARGEST_GLANCE[0]
    assert np.abs(moved.gaze_x).max() > 0.02
    assert (np.abs(np.diff(moved.gaze_x)) < 1e-6).mean() > 0.8


def test_the_head_moves_slowly():
    head = expression(frames(100), MINUTE, SAID, None).head
    assert np.abs(np.diff(head, axis=0)).max() < 0.004
    assert np.ptp(head[:, 2]) > 0.02


def test_without_time_and_phones_nothing_fails():
    nothing = Motion(np.zeros((1, 1)), 100.0, (Channel("opening"),))
    moved = expression(np.zeros(1), nothing, Timeline(()), None)
    assert len(moved.lids) == len(moved.head) == 1
