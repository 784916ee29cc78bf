import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.faces.portrait.pose import (
    CLOSED_BELOW,
    LIP_SPEED,
    PARTED,
    PURSED_GAP,
    TUCKED_GAP,
    WIDEST,
    MouthPose,
    drawn_gap,
    jaw_drop,
    mouth_poses,
    upper_share,
)
from lipmotion.types import Channel, Motion, Span, Timeline, Unit

NOTHING_SAID: Timeline[Unit] = Timeline(())


def motion(rate_hz: float = 25.0, **curves: list[float] | np.ndarray) -> Motion:
    values = np.stack([np.asarray(curve, dtype=np.float64) for curve in curves.values()], axis=1)
    return Motion(values, rate_hz, tuple(Channel(name) for name in curves))


def said(*spans: tuple[float, float, str]) -> Timeline[Unit]:
    return Timeline(tuple(Span(start, end, Unit(phone)) for start, end, phone in spans))


def test_lips_that_nearly_touch_are_drawn_shut():
    assert drawn_gap(np.array([-0.01, 0, 0.005, CLOSED_BELOW])).tolist() == [0, 0, 0, 0]


def test_small_openings_are_drawn_large_enough_to_be_seen():
    """The tracker sees drawn lips that are less than 0.045 apart as closed, and measured people no better."""
    assert drawn_gap(np.array([PARTED, 0.04])).min() > 0.045
    large = np.array([0.08, 0.12, 0.16])
    assert (drawn_gap(large) > 1.15 * large).all()
    assert (drawn_gap(large) < 1.8 * large).all()


def test_the_gap_grows_steadily_and_has_an_end():
    for intensity in (0.5, 1.0, 3.0):
        gap = drawn_gap(np.linspace(0, 1, 1001), intensity)
        assert (np.diff(gap) >= 0).all()
        assert np.diff(gap).max() < 0.003 * max(intensity, 1)
        assert gap[-1] == pytest.approx(WIDEST, abs=0.05)
        assert gap.max() <= WIDEST


@pytest.mark.parametrize("intensity", [0.5, 3.0])
def test_intensity_keeps_closures_and_adds_no_jumps(intensity):
    time_s = np.arange(201) / 100
    opening = np.maximum(0.12 * np.sin(2 * np.pi * 1.5 * time_s), 0)
    width = 0.57 + 0.03 * np.sin(2 * np.pi * 0.7 * time_s)
    drawn, plain = (
        mouth_poses(motion(100.0, opening=opening, width=width), said((0, 0.05, "sil")), 100.0, x)
        for x in (intensity, 1.0)
    )
    for one, other in zip(drawn, plain, strict=True):
        assert (one.gap == 0) == (other.gap == 0)
        assert (one.gap >= other.gap) == (intensity >= 1) or one.gap == 0
    steps = np.abs(np.diff([pose.gap for pose in drawn])).max()
    assert steps < 1.2 * max(intensity, 1) * np.abs(np.diff([pose.gap for pose in plain])).max()


@pytest.mark.parametrize("fps", [25.0, 29.97])
def test_there_is_a_pose_for_every_frame_to_the_end_of_the_motion(fps):
    poses = mouth_poses(motion(100.0, opening=np.linspace(0, 0.2, 201)), NOTHING_SAID, fps)
    assert len(poses) == int(2.0 * fps + 1e-6) + 1
    middle = round(fps)
    assert poses[middle].gap == pytest.approx(float(drawn_gap(np.array(0.1 * middle / fps))), abs=1e-3)


def test_a_closure_between_two_video_frames_is_shown():
    opening = np.full(101, 0.1)
    opening[50:52] = 0.0  # 0.50 and 0.51 s; frames at 25 fps stand at 0.48 and 0.52 s
    gaps = [pose.gap for pose in mouth_poses(motion(100.0, opening=opening), NOTHING_SAID, 25.0)]
    assert np.flatnonzero(np.array(gaps) == 0).tolist() in ([12], [13], [12, 13])
    assert gaps[11] == pytest.approx(gaps[14])
    assert gaps[11] > 0.1


def test_speakers_with_different_rest_poses_draw_alike():
    time_s = np.arange(100) / 25
    opening = 0.06 * (1 - np.cos(2 * np.pi * time_s))
    stretch = 1 + 0.06 * np.sin(2 * np.pi * time_s) * (opening > 0.01)
    wide = motion(opening=opening, width=0.64 * stretch, outer=0.25 + opening)
    narrow = motion(opening=opening, width=0.50 * stretch, outer=0.20 + opening)
    for first, second in zip(mouth_poses(wide, NOTHING_SAID, 25), mouth_poses(narrow, NOTHING_SAID, 25), strict=True):
        assert tuple(first) == pytest.approx(tuple(second))


def test_the_rest_is_taken_from_silence():
    width = np.r_[np.full(50, 0.5), np.full(50, 0.6)]
    still = motion(opening=np.r_[np.full(50, 0.02), np.zeros(50)], width=width)
    assert mouth_poses(still, NOTHING_SAID, 25)[75].width == pytest.approx(1)
    assert mouth_poses(still, said((0, 2, "sil"), (2, 4, "p")), 25)[25].width == pytest.approx(1)
    assert mouth_poses(still, said((0, 2, "sil"), (2, 4, "p")), 25)[75].width > 1.1


def test_width_moves_further_than_measured_but_not_without_end():
    moved = motion(opening=np.zeros(100), width=np.r_[np.full(60, 0.5), np.full(20, 0.52), np.full(20, 0.05)])
    poses = mouth_poses(moved, said((0, 2.4, "sil")), 25)
    assert poses[70].width == pytest.approx(1.078, abs=0.003)
    assert 0.68 <= poses[90].width < 0.7


def test_the_opening_alone_is_enough():
    poses = mouth_poses(motion(opening=[0, 0.1, 0.3]), NOTHING_SAID, 25)
    assert poses[0].width == poses[0].fullness == 1
    assert poses[2].width < poses[1].width < 1
    assert [pose.jaw for pose in poses] == pytest.approx(jaw_drop(drawn_gap(np.array([0, 0.1, 0.3]))))


def test_the_tracked_chin_moves_the_jaw_within_reason():
    opening = np.r_[np.zeros(20), np.full(60, 0.1)]
    chin = np.r_[np.full(20, -1.4), np.full(20, -1.46), np.full(20, -1.4), np.full(20, -2.0)]
    poses = mouth_poses(motion(opening=opening, y_152=chin), NOTHING_SAID, 25)
    usual = float(jaw_drop(drawn_gap(np.array(0.1))))
    assert 0.6 * usual <= poses[30].jaw <= 1.15 * usual + 0.01
    assert poses[50].jaw == pytest.approx(0.6 * usual)
    assert poses[70].jaw == pytest.approx(1.15 * usual + 0.01)


def test_the_upper_lip_rises_less_than_the_lower_one_falls():
    gap = np.linspace(0.01, WIDEST, 50)
    assert (upper_share(gap) < 0.32 * gap).all()
    assert (upper_share(gap) < 0.06).all()


def test_f_and_v_tuck_the_lip_and_show_the_teeth():
    for phone in ("f", "v"):
        poses = mouth_poses(motion(opening=np.zeros(50)), said((0.8, 1.2, phone)), 25)
        assert poses[25].tuck == pytest.approx(1, abs=1e-3)
        assert poses[25].gap == pytest.approx(TUCKED_GAP[0], abs=1e-3)
        assert poses[5].tuck < 1e-3
        assert poses[5].gap < 1e-3
        wide = mouth_poses(motion(opening=np.full(50, 0.2)), said((0.8, 1.2, phone)), 25)
        assert wide[25].gap == pytest.approx(TUCKED_GAP[1], abs=2e-3)


def test_lips_close_even_next_to_f():
    opening = np.full(101, 0.05)
    opening[50:60] = 0
    for phone in ("p", "b", "m"):
        poses = mouth_poses(motion(100.0, opening=opening), said((0.3, 0.5, "f"), (0.5, 0.6, phone)), 100.0)
        assert [pose.gap for pose in poses[50:60]] == [0] * 10


def test_the_tip_of_the_tongue_rises():
    for phone in ("th", "dh", "l", "d", "n", "t"):
        poses = mouth_poses(motion(opening=np.full(50, 0.1)), said((0.8, 1.2, phone)), 25)
        assert 0.4 < poses[25].tongue <= 1
        assert poses[5].tongue < 1e-3


def test_a_motion_without_opening_is_refused():
    with pytest.raises(InputError, match=r"no channel 'opening'.*width, outer"):
        mouth_poses(motion(width=[1.0], outer=[1.0]), NOTHING_SAID, 25)


def test_values_that_are_not_finite_are_refused():
    for channel in ("opening", "width", "outer", "y_152"):
        curves = {"opening": [0.0, 0.1], channel: [0.5, np.nan]}
        with pytest.raises(InputError, match=f"'{channel}' has values that are not finite"):
            mouth_poses(motion(**curves), NOTHING_SAID, 25)  # type: ignore[arg-type]


def test_no_frames_no_rate_and_no_size_are_refused():
    with pytest.raises(InputError, match="no frames"):
        mouth_poses(motion(opening=[]), NOTHING_SAID, 25)
    for fps in (0, -1, float("nan"), float("inf")):
        with pytest.raises(InputError, match="frame rate"):
            mouth_poses(motion(opening=[0.0]), NOTHING_SAID, fps)
    with pytest.raises(InputError, match="width is 0 at rest"):
        mouth_poses(motion(opening=[0.0], width=[0.0]), NOTHING_SAID, 25)
    with pytest.raises(InputError, match="thickness of the lips"):
        mouth_poses(motion(opening=[0.2], outer=[0.2]), NOTHING_SAID, 25)


def test_the_mouth_is_closed_in_pauses_and_shows_no_teeth_even_in_short_ones() -> None:
    units = Timeline((Span(0.0, 0.5, Unit("eh")), Span(0.5, 1.0, Unit("sp")), Span(1.0, 1.5, Unit("eh"))))
    motion = Motion(np.full((151, 1), 0.1), 100.0, (Channel("opening"),))
    poses = mouth_poses(motion, units, 25)
    assert poses[6].teeth > 0.5
    assert poses[6].gap > 0.1
    assert poses[19].teeth < 0.02
    assert poses[19].gap < 1e-6
    short = Timeline((Span(0.0, 0.7, Unit("eh")), Span(0.7, 0.8, Unit("sp")), Span(0.8, 1.5, Unit("eh"))))
    assert min(pose.teeth for pose in mouth_poses(motion, short, 100)) < 0.1


def test_articulatory_channels_of_the_motion_are_drawn_instead_of_those_of_the_phones() -> None:
    channels = (Channel("opening"), Channel("tongue", "weight"), Channel("teeth", "weight"))
    given = Motion(np.tile([0.1, 0.7, 0.2], (101, 1)), 100.0, channels)
    poses = mouth_poses(given, said((0, 0.5, "th"), (0.5, 1.0, "uw")), 25)
    assert [pose.tongue for pose in poses] == pytest.approx([0.7] * len(poses))
    assert [pose.teeth for pose in poses] == pytest.approx([0.2] * len(poses))
    assert poses[19].protrusion > 0.9


def middle_pose(phone: str, opening: float = 0.06, width: float = 0.57) -> MouthPose:
    """Return the pose in the middle of a phone between silences, whatever is measured there."""
    said_s = said((0, 0.2, "sil"), (0.3, 0.7, phone))
    time_s = np.arange(101) / 100
    return mouth_poses(
        motion(100.0, opening=np.full(101, opening), width=np.where(time_s < 0.25, 0.57, width)), said_s, 25
    )[12]


def test_every_sound_has_a_pose_of_its_own() -> None:
    """At one measured opening and width, oo is narrower than ee, which is wider than at rest; at usual ones far so."""
    ee, oo = middle_pose("iy"), middle_pose("uw")
    assert oo.width < 0.9 * ee.width
    assert middle_pose("uw", width=0.54).width < 0.78 * middle_pose("iy", width=0.585).width
    assert ee.width > 1.03
    assert ee.teeth > 0.8
    assert oo.teeth < 0.1


def test_w_is_a_smaller_hole_in_narrower_lips_than_oo() -> None:
    for opening in (0.04, 0.08):
        w, oo = middle_pose("w", opening), middle_pose("uw", opening)
        assert min(w.protrusion, oo.protrusion) > 0.9
        assert 0 < w.gap <= PURSED_GAP[1] + 1e-3
        assert oo.gap > 1.4 * w.gap
        assert w.width < oo.width - 0.04


def test_w_opens_quickly_and_oo_is_held() -> None:
    def gaps(phone: str) -> np.ndarray:
        units = said((0, 0.2, "sil"), (0.3, 0.5, phone), (0.5, 0.8, "ah"))
        return np.array([pose.gap for pose in mouth_poses(motion(100.0, opening=np.full(101, 0.06)), units, 100.0)])

    w, oo = gaps("w"), gaps("uw")
    assert w[54] > 1.4 * w[40]
    assert np.ptp(oo[34:48]) < 0.01


def test_aa_is_taller_and_narrower_than_the_same_opening_of_another_vowel() -> None:
    aa, eh = middle_pose("aa", 0.14), middle_pose("eh", 0.14)
    assert aa.oval > 0.8
    assert eh.oval < 0.4
    assert aa.gap > 1.1 * eh.gap
    assert aa.width < eh.width - 0.08
    assert aa.jaw > eh.jaw


def test_lips_that_were_tracked_as_closed_part_for_th_and_w_but_not_beside_b() -> None:
    closed = motion(100.0, opening=np.zeros(101))
    for phone in ("th", "dh", "w"):
        poses = mouth_poses(closed, said((0.3, 0.4, phone), (0.4, 0.5, "b"), (0.5, 0.6, phone)), 100.0)
        assert poses[33].gap > 0.03
        assert [pose.gap for pose in poses[42:48]] == [0] * 6


def test_without_intensity_the_lips_stay_closed() -> None:
    for phone in ("f", "th", "w"):
        units = said((0.3, 0.6, phone))
        poses = mouth_poses(motion(100.0, opening=np.full(101, 0.1)), units, 25.0, intensity=0.0)
        assert max(pose.gap for pose in poses) < 1e-9


@pytest.mark.parametrize("fps", [25.0, 100.0])
def test_beside_f_the_lip_moves_no_faster_than_lips_do(fps: float) -> None:
    units = said((0, 0.3, "aa"), (0.3, 0.4, "f"), (0.4, 0.8, "aa"))
    poses = mouth_poses(motion(100.0, opening=np.full(81, 0.2)), units, fps)
    gaps, tucks = (np.array([getattr(pose, name) for pose in poses]) for name in ("gap", "tuck"))
    leaving = np.abs(np.diff(gaps))[(tucks[:-1] > 0.5) != (tucks[1:] > 0.5)]
    assert len(leaving) == 2
    assert leaving.max() <= LIP_SPEED / fps + 1e-9
    assert gaps.max() > 0.2


def test_the_chin_rises_for_f() -> None:
    assert middle_pose("f").jaw < 0.6 * middle_pose("s", 0.03).jaw
