import numpy as np
import pytest

from faces.head.motions import NOTHING_SAID, opening, said, steady
from lipmotion.errors import InputError
from lipmotion.types import Channel, Motion, Prosody
from lipmotion.units import LIP_CLOSING
from lipmotion_faces.head.pose import head_poses


def middle(phone: str, value: float = 0.08, before: str = "ah", after: str = "ah"):
    """Return the pose in the middle of a phone."""
    phones = (before, phone, after)
    return head_poses(steady(phones, value), said(*phones), 25.0)[15]


def test_p_b_and_m_are_closed_exactly_whatever_the_motion_is():
    for value, phone in enumerate(sorted(LIP_CLOSING)):
        poses = head_poses(steady(("aa", phone, "aa"), 0.04 * value), said("aa", phone, "aa"), 25.0)
        assert min(pose.gap for pose in poses[10:20]) == 0
        assert poses[15].press > 0.9


def test_a_closed_sound_shorter_than_a_frame_is_closed_in_one():
    for start in (0.0, 0.013, 0.02, 0.031):
        labels = said("aa", "b", duration_s=0.02).shifted(0.4 + start)
        poses = head_poses(steady(("aa", "aa", "aa"), 0.1), labels, 25.0)
        assert 1 <= sum(pose.gap == 0 for pose in poses) <= 2


def test_each_sound_has_its_own_shape():
    f, th, oo, ee, n, s = (middle(phone) for phone in ("f", "th", "uw", "iy", "n", "s"))
    aa = middle("aa", 0.18)
    assert min(f.tuck, th.tongue_out, aa.oval, s.bite) > 0.9
    assert oo.roundness > 0.75
    assert max(pose.tuck for pose in (th, oo, aa, ee, n, s)) < 0.1
    assert max(pose.tongue_out for pose in (f, oo, aa, ee, n, s)) < 0.1
    assert max(pose.roundness for pose in (f, th, aa, ee, n, s)) < 0.2
    assert max(pose.bite for pose in (f, th, oo, aa, n)) < 0.1
    assert n.tongue_up > 0.5
    assert oo.protrusion > 0.05
    assert oo.width < aa.width < ee.width


def test_the_motion_alone_moves_the_corners():
    values = np.array([[0.05, width] for width in (0.57, 0.57, 0.57, 0.5, 0.5, 0.62, 0.62)])
    motion = Motion(values, 25.0, (Channel("opening"), Channel("width")))
    narrow, wide = (head_poses(motion, NOTHING_SAID, 25.0)[frame] for frame in (4, 6))
    assert narrow.width < 0.95
    assert wide.width > 1.05
    assert narrow.roundness > wide.roundness
    assert wide.spread > narrow.spread


def test_tracked_jaws_are_followed_within_limits():
    values = np.array([[0.0, -1.0], [0.2, -1.05], [0.2, -1.15], [0.2, -9.0]])
    motion = Motion(np.repeat(values, 3, axis=0), 25.0, (Channel("opening"), Channel("y_152")))
    jaws = [head_poses(motion, NOTHING_SAID, 25.0)[frame].jaw for frame in (1, 4, 7, 10)]
    assert jaws[0] == pytest.approx(0, abs=0.011)
    assert jaws[1] < jaws[2] < jaws[3] < 0.25


def test_an_unusable_motion_is_refused():
    with pytest.raises(InputError, match="no channel 'opening'"):
        head_poses(Motion(np.zeros((3, 1)), 25.0, (Channel("width"),)), NOTHING_SAID, 25.0)
    with pytest.raises(InputError, match="frame rate"):
        head_poses(opening(0.0), NOTHING_SAID, 0.0)


def test_articulatory_channels_of_the_motion_come_before_the_phones():
    names = ("opening", "tongue", "lip_tuck", "teeth")
    rows = np.tile([0.08, 1.0, 0.0, 1.0], (31, 1))
    motion = Motion(rows, 25.0, tuple(map(Channel, names)))
    pose = head_poses(motion, said("f", "aa", "f"), 25.0)[15]
    assert pose.tongue_out > 0.99
    assert pose.bite > 0.99
    assert head_poses(motion, said("f", "f", "f"), 25.0)[15].tuck < 0.01


def test_a_loud_high_voice_raises_the_brows():
    level, pitch = np.full(300, -30.0), np.full(300, np.log(150.0))
    level[150:170], pitch[150:170] = -10.0, np.log(260.0)
    motion = opening(*[0.05] * 75)
    flat = Prosody(np.full(300, -10.0), np.full(300, np.log(150.0)))
    with_voice, without = (
        head_poses(motion, said("aa", duration_s=3), 25.0, prosody=p) for p in (Prosody(level, pitch), flat)
    )
    assert with_voice[35].brows > without[35].brows + 0.005
