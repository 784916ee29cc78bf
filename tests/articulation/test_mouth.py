import numpy as np
import pytest

from lipmotion.articulation.contact import opening_to_gap
from lipmotion.articulation.mouth import LIP_SPEED, PURSED_GAP, TUCKED_GAP, WIDTH_REACH, find_mouth, measure_jaw_drop
from lipmotion.errors import InputError
from lipmotion.types import Channel, Motion, Timeline, Unit
from meshes.speech import said

NOTHING_SAID: Timeline[Unit] = Timeline(())


def motion(rate_hz: float = 25.0, **curves: list[float] | np.ndarray) -> Motion:
    values = np.stack([np.asarray(curve, dtype=np.float64) for curve in curves.values()], axis=1)
    return Motion(values, rate_hz, tuple(Channel(name) for name in curves))


def in_phone(phone: str, opening: float = 0.06, width: float = 0.57) -> dict[str, float]:
    """Return the mouth in the middle of a phone after silence, whatever is measured there."""
    moved = motion(100.0, opening=np.full(101, opening), width=np.where(np.arange(101) < 25, 0.57, width))
    return list(find_mouth(moved, said((0, 0.2, "sil"), (0.3, 0.7, phone))).rows())[50]


def test_speakers_with_different_rest_poses_move_alike():
    opening = 0.06 * (1 - np.cos(2 * np.pi * np.arange(100) / 25))
    stretch = 1 + 0.06 * np.sin(2 * np.pi * np.arange(100) / 25) * (opening > 0.01)
    wide, narrow = (
        find_mouth(motion(opening=opening, width=width * stretch, outer=outer + opening), NOTHING_SAID)
        for width, outer in ((0.64, 0.25), (0.50, 0.20))
    )
    for one, other in zip(wide.rows(), narrow.rows(), strict=True):
        assert one == pytest.approx(other)


def test_the_rest_is_taken_from_silence():
    still = motion(opening=np.r_[np.full(50, 0.02), np.zeros(50)], width=np.r_[np.full(50, 0.5), np.full(50, 0.6)])
    assert find_mouth(still, NOTHING_SAID).width[75] == pytest.approx(1)
    units = said((0, 2, "sil"), (2, 4, "p"))
    assert find_mouth(still, units).width[25] == pytest.approx(1)
    assert find_mouth(still, units).width[75] > 1.1


def test_width_is_as_measured_but_not_without_end():
    moved = motion(opening=np.zeros(100), width=np.r_[np.full(60, 0.5), np.full(20, 0.52), np.full(20, 0.05)])
    width = find_mouth(moved, said((0, 2.4, "sil"))).width
    assert width[70] == pytest.approx(1.04, abs=0.002)
    assert 1 - WIDTH_REACH <= width[90] < 0.72


def test_the_tracked_chin_moves_the_jaw_within_reason():
    opening = np.r_[np.zeros(20), np.full(60, 0.1)]
    chin = np.r_[np.full(20, -1.4), np.full(20, -1.475), np.full(20, -1.4), np.full(20, -2.0)]
    jaw = find_mouth(motion(opening=opening, y_152=chin), NOTHING_SAID).jaw
    usual = float(measure_jaw_drop(opening_to_gap(np.array(0.1))))
    assert 0.75 * usual < jaw[30] < 1.15 * usual + 0.01
    assert jaw[50] == pytest.approx(0.75 * usual)
    assert jaw[70] == pytest.approx(1.15 * usual + 0.01)


def test_f_and_v_tuck_the_lip_and_show_the_teeth():
    for phone in ("f", "v"):
        for opening, gap in ((0.0, TUCKED_GAP[0]), (0.2, TUCKED_GAP[1])):
            mouth = find_mouth(motion(opening=np.full(50, opening)), said((0.8, 1.2, phone)))
            assert mouth.tuck[25] == pytest.approx(1, abs=1e-3)
            assert mouth.gap[25] == pytest.approx(gap, abs=2e-3)
            assert mouth.tuck[5] < 1e-3
            assert mouth.contact[5] == (opening == 0)


def test_the_tip_of_the_tongue_rises():
    for phone in ("th", "dh", "l", "d", "n", "t"):
        mouth = find_mouth(motion(opening=np.full(50, 0.1)), said((0.8, 1.2, phone)))
        assert 0.4 < mouth.tongue[25] <= 1
        assert (mouth.between_teeth[25] > 0.9) == (phone in ("th", "dh"))
        assert mouth.tongue[5] < 1e-3


def test_every_sound_has_a_mouth_of_its_own():
    """At one measured opening and width, oo is narrower than ee, which is wider than at rest; at usual ones far so."""
    ee, oo = in_phone("iy"), in_phone("uw")
    assert oo["width"] < 0.88 * ee["width"]
    assert in_phone("uw", width=0.5)["width"] < 0.895
    assert ee["width"] > 1.03
    assert ee["teeth"] > 0.75
    assert oo["teeth"] < 0.1
    aa, eh = in_phone("aa", 0.16), in_phone("eh", 0.16)
    assert aa["oval"] > 0.7
    assert eh["oval"] < 0.4
    assert aa["width"] < eh["width"]
    assert in_phone("f")["jaw"] < 0.6 * in_phone("s", 0.04)["jaw"]


def test_w_is_a_smaller_hole_than_oo_and_opens_sooner():
    for opening in (0.04, 0.08):
        w, oo = in_phone("w", opening), in_phone("uw", opening)
        assert min(w["protrusion"], oo["protrusion"]) > 0.9
        assert 0 < w["gap"] <= PURSED_GAP[1] + 1e-3
        assert oo["gap"] > w["gap"] + 0.005
    gaps = {}
    for phone in ("w", "uw"):
        units = said((0, 0.2, "sil"), (0.3, 0.5, phone), (0.5, 0.8, "ah"))
        gaps[phone] = find_mouth(motion(100.0, opening=np.full(101, 0.06)), units).gap
    assert gaps["w"][54] > 1.3 * gaps["w"][40]
    assert np.ptp(gaps["uw"][34:48]) < 0.01


def test_lips_that_were_tracked_as_closed_part_for_th_and_w_but_not_beside_b():
    closed = motion(100.0, opening=np.zeros(101))
    for phone in ("th", "dh", "w"):
        mouth = find_mouth(closed, said((0.3, 0.4, phone), (0.4, 0.5, "b"), (0.5, 0.6, phone)))
        assert mouth.gap[33] > 0.02
        assert mouth.contact[43:48].all()


@pytest.mark.parametrize("fps", [25.0, 100.0])
def test_beside_f_the_lip_moves_no_faster_than_lips_do(fps):
    units = said((0, 0.3, "aa"), (0.3, 0.4, "f"), (0.4, 0.8, "aa"))
    mouth = find_mouth(motion(100.0, opening=np.full(81, 0.2)), units, fps)
    leaving = np.abs(np.diff(mouth.gap))[(mouth.tuck[:-1] > 0.5) != (mouth.tuck[1:] > 0.5)]
    assert len(leaving) == 2
    assert leaving.max() <= LIP_SPEED / fps + 1e-9
    assert mouth.gap.max() > 0.2


def test_articulatory_channels_of_the_motion_count_instead_of_those_of_the_phones():
    channels = (Channel("opening"), Channel("tongue", "weight"), Channel("teeth", "weight"))
    given = Motion(np.tile([0.1, 0.7, 0.2], (101, 1)), 100.0, channels)
    mouth = find_mouth(given, said((0, 0.5, "th"), (0.5, 1.0, "uw")))
    assert mouth.tongue == pytest.approx(0.7)
    assert mouth.teeth == pytest.approx(0.2)
    assert mouth.protrusion[75] > 0.9


def test_of_motion_that_has_the_gap_itself_phones_say_only_that_p_b_and_m_close():
    gap = np.full(101, 0.1)
    both = motion(100.0, opening=gap, lip_gap=gap)
    mouth = find_mouth(both, said((0, 0.3, "f"), (0.3, 0.5, "aa"), (0.5, 0.6, "m"), (0.6, 1.0, "th")))
    assert mouth.contact[55]
    assert mouth.gap[[10, 40, 80]] == pytest.approx(0.1)


def test_unusable_motion_is_refused():
    wrong = [
        ({"width": [1.0], "outer": [1.0]}, r"no channel 'opening'.*width, outer"),
        ({"opening": []}, "no frames"),
        ({"opening": [0.0], "width": [0.0]}, "width is 0 at rest"),
        ({"opening": [0.2], "outer": [0.2]}, "thickness of the lips"),
    ]
    for channel in ("opening", "width", "outer", "y_152"):
        wrong.append(({"opening": [0.0, 0.1], channel: [0.5, np.nan]}, f"'{channel}' has values that are not finite"))
    for curves, words in wrong:
        with pytest.raises(InputError, match=words):
            find_mouth(motion(**curves), NOTHING_SAID)  # type: ignore[arg-type]
    for fps in (0, float("nan")):
        with pytest.raises(InputError, match="frame rate"):
            find_mouth(motion(opening=[0.0]), NOTHING_SAID, fps)


def test_future_is_not_spread():
    phones, lengths_s = ("f", "y", "uw", "ch", "axr"), (0.09, 0.06, 0.12, 0.1, 0.12)
    ends_s = 0.3 + np.cumsum(lengths_s)
    spans = [(float(end - length), float(end), p) for p, length, end in zip(phones, lengths_s, ends_s, strict=True)]
    moved = motion(100.0, opening=np.full(101, 0.06), width=np.full(101, 0.57))
    mouth = find_mouth(moved, said((0, 0.3, "sil"), *spans))
    assert mouth.width.max() < 1.02
    assert mouth.width[round(100 * (ends_s[1] - 0.03))] < 0.95  # y rounds for the vowel behind it
