import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.faces.portrait.pose import CLOSED_BELOW, WIDEST, drawn_gap, jaw_drop, mouth_poses, upper_share
from lipmotion.types import Channel, Motion, Span, Timeline, Unit

NOTHING_SAID: Timeline[Unit] = Timeline(())


def motion(rate_hz: float = 25.0, **curves: list[float] | np.ndarray) -> Motion:
    values = np.stack([np.asarray(curve, dtype=np.float64) for curve in curves.values()], axis=1)
    return Motion(values, rate_hz, tuple(Channel(name) for name in curves))


def said(*spans: tuple[float, float, str]) -> Timeline[Unit]:
    return Timeline(tuple(Span(start, end, Unit(phone)) for start, end, phone in spans))


def test_lips_that_nearly_touch_are_drawn_shut():
    assert drawn_gap(np.array([-0.01, 0, 0.005, CLOSED_BELOW])).tolist() == [0, 0, 0, 0]


def test_the_gap_is_the_opening_once_the_mouth_is_open():
    opening = np.array([0.03, 0.05, 0.12, 0.35])
    assert drawn_gap(opening) == pytest.approx(opening)


def test_the_gap_grows_steadily_and_has_an_end():
    gap = drawn_gap(np.linspace(0, 1, 1001))
    assert (np.diff(gap) >= 0).all()
    assert np.diff(gap).max() < 0.002
    assert gap[-1] == WIDEST


@pytest.mark.parametrize("fps", [24.0, 25.0, 29.97, 30.0, 60.0])
def test_there_is_a_pose_for_every_frame_to_the_end_of_the_motion(fps):
    poses = mouth_poses(motion(100.0, opening=np.linspace(0, 0.2, 201)), NOTHING_SAID, fps)
    assert len(poses) == int(2.0 * fps + 1e-6) + 1
    middle = round(fps)
    assert poses[middle].gap == pytest.approx(0.1 * middle / fps, abs=1e-6)


def test_a_closure_between_two_video_frames_is_shown():
    opening = np.full(101, 0.1)
    opening[50:52] = 0.0  # 0.50 and 0.51 s; frames at 25 fps stand at 0.48 and 0.52 s
    gaps = [pose.gap for pose in mouth_poses(motion(100.0, opening=opening), NOTHING_SAID, 25.0)]
    assert np.flatnonzero(np.array(gaps) == 0).tolist() in ([12], [13], [12, 13])
    assert gaps[11] == gaps[14] == pytest.approx(0.1)


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
    assert poses[70].width == pytest.approx(1.06, abs=0.003)
    assert 0.7 <= poses[90].width < 0.71


def test_the_opening_alone_is_enough():
    poses = mouth_poses(motion(opening=[0, 0.1, 0.3]), NOTHING_SAID, 25)
    assert poses[0].width == poses[0].fullness == 1
    assert poses[2].width < poses[1].width < 1
    assert [pose.jaw for pose in poses] == pytest.approx(jaw_drop(np.array([0, 0.1, 0.3])))


def test_the_tracked_chin_moves_the_jaw_within_reason():
    opening = np.r_[np.zeros(20), np.full(60, 0.1)]
    chin = np.r_[np.full(20, -1.4), np.full(20, -1.46), np.full(20, -1.4), np.full(20, -2.0)]
    poses = mouth_poses(motion(opening=opening, y_152=chin), NOTHING_SAID, 25)
    usual = float(jaw_drop(0.1))
    assert poses[30].jaw == pytest.approx(0.06)
    assert poses[50].jaw == pytest.approx(0.6 * usual)
    assert poses[70].jaw == pytest.approx(1.15 * usual + 0.01)


def test_the_upper_lip_rises_less_than_the_lower_one_falls():
    gap = np.linspace(0.01, WIDEST, 50)
    assert (upper_share(gap) < 0.32 * gap).all()
    assert (upper_share(gap) < 0.06).all()


@pytest.mark.parametrize("phone", ["f", "v"])
def test_f_and_v_tuck_the_lip_and_show_the_teeth(phone):
    poses = mouth_poses(motion(opening=np.zeros(50)), said((0.8, 1.2, phone)), 25)
    assert poses[25].tuck == pytest.approx(1)
    assert poses[25].gap == pytest.approx(0.03)
    assert poses[5].tuck == poses[5].gap == 0
    wide = mouth_poses(motion(opening=np.full(50, 0.2)), said((0.8, 1.2, phone)), 25)
    assert wide[25].gap == pytest.approx(0.055)


@pytest.mark.parametrize("phone", ["p", "b", "m"])
def test_lips_close_even_next_to_f(phone):
    opening = np.full(101, 0.05)
    opening[50:60] = 0
    poses = mouth_poses(motion(100.0, opening=opening), said((0.3, 0.5, "f"), (0.5, 0.6, phone)), 100.0)
    assert [pose.gap for pose in poses[50:60]] == [0] * 10


@pytest.mark.parametrize("phone", ["th", "dh", "l", "d", "n", "t"])
def test_the_tip_of_the_tongue_rises(phone):
    poses = mouth_poses(motion(opening=np.full(50, 0.1)), said((0.8, 1.2, phone)), 25)
    assert 0.3 < poses[25].tip <= 1
    assert poses[5].tip == 0


def test_a_motion_without_opening_is_refused():
    with pytest.raises(InputError, match=r"no channel 'opening'.*width, outer"):
        mouth_poses(motion(width=[1.0], outer=[1.0]), NOTHING_SAID, 25)


@pytest.mark.parametrize("channel", ["opening", "width", "outer", "y_152"])
def test_values_that_are_not_finite_are_refused(channel):
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


def test_teeth_are_hidden_in_pauses_and_seen_in_speech() -> None:
    units = Timeline((Span(0.0, 0.5, Unit("aa")), Span(0.5, 1.0, Unit("sp")), Span(1.0, 1.5, Unit("aa"))))
    motion = Motion(np.full((151, 1), 0.1), 100.0, (Channel("opening"),))
    poses = mouth_poses(motion, units, 25)
    assert poses[6].teeth == pytest.approx(1)
    assert poses[6].gap == pytest.approx(0.1)
    assert poses[19].teeth == pytest.approx(0)
    assert poses[19].gap < 0.04
    short = Timeline((Span(0.0, 0.7, Unit("aa")), Span(0.7, 0.8, Unit("sp")), Span(0.8, 1.5, Unit("aa"))))
    assert min(pose.teeth for pose in mouth_poses(motion, short, 25)) == pytest.approx(1)
