from dataclasses import replace

import numpy as np
import pytest

from lipmotion.articulation.lip_points import make_symmetrical
from lipmotion.articulation.phone_targets import GESTURES, gesture_curves, with_gestures
from lipmotion.types import WEIGHT, Channel, Motion, Span, Timeline, Unit
from meshes.speech import motion

TIME_S = np.arange(0, 1.2, 0.01)


def said(*phones: str, each_s: float = 0.12) -> Timeline[Unit]:
    return Timeline(tuple(Span(i * each_s, (i + 1) * each_s, Unit(phone)) for i, phone in enumerate(phones)))


def middle(phones: tuple[str, ...], number: int, name: str, each_s: float = 0.12) -> float:
    return float(gesture_curves(said(*phones, each_s=each_s), np.array([(number + 0.5) * each_s]), [name])[name][0])


def test_a_phone_reaches_its_target_whatever_is_beside_it():
    asked = {"f": "lip_tuck", "th": "tongue", "uw": "protrusion", "iy": "spread", "p": "lip_press", "s": "teeth"}
    for phone, name in asked.items():
        for left in ("aa", "iy", "uw", "m", "f", "th", "sil"):
            if left != phone:
                assert middle((left, phone, "aa"), 1, name) > 0.85


def test_lips_round_before_the_vowel_that_needs_it_and_other_targets_end_where_they_cannot_be():
    assert middle(("s", "t", "uw"), 1, "protrusion") > 0.3
    assert middle(("s", "t", "iy"), 1, "protrusion") < 0.05
    assert middle(("f", "m", "v"), 1, "lip_tuck") < 0.05  # no tuck while the lips are closed
    for pause in ("sil", "sp"):
        assert middle(("s", pause, "s"), 1, "teeth") < 0.1
    quick = {"teeth": (("t", "ae", "t"), ("z", "uw", "z")), "tongue": (("th", "ih", "th"), ("l", "ah", "l"))}
    quick["protrusion"] = ("uw", "f", "w"), ("ao", "th", "r")
    for name, heard in quick.items():  # of 70 ms
        assert max(middle(phones, 1, name, 0.07) for phones in heard) < (0.7 if name == "teeth" else 0.4)


def test_without_phones_there_is_the_pose_of_speech():
    curves = gesture_curves(Timeline(()), TIME_S)
    assert curves.pop("teeth") == pytest.approx(np.full(len(TIME_S), 0.5))
    assert not np.any(list(curves.values()))


def test_channels_are_added_where_they_lack():
    motion = Motion(np.full((50, 2), 0.3), 100.0, (Channel("opening"), Channel("tongue", WEIGHT)))
    more = with_gestures(motion, said("f", "th"))
    assert more.names == ("opening", "tongue", *(name for name in GESTURES if name != "tongue"))
    assert more["tongue"] == pytest.approx(0.3)
    assert more["lip_tuck"].max() > 0.9
    assert with_gestures(more, said("f")) is more


def test_both_sides_move_alike_by_as_much_as_is_asked_for():
    moved = motion()
    values = moved.values.copy()
    values[:, moved.column("y_61")] += 0.02
    lopsided = replace(moved, values=values)
    for asymmetry, left in ((0.0, 0.0), (0.5, 0.01), (1.0, 0.02)):
        alike = make_symmetrical(lopsided, asymmetry)
        assert alike["y_61"] - alike["y_291"] == pytest.approx(left, abs=1e-9)
        assert alike["x_61"] + alike["x_291"] == pytest.approx(0.0, abs=1e-9)
        assert alike["opening"] == pytest.approx(moved["opening"])
    usual = make_symmetrical(lopsided)
    assert make_symmetrical(usual, 0.0)["y_61"] == pytest.approx(usual["y_61"])
    distances = motion(points=False)  # motion without points stays as it is
    assert make_symmetrical(distances) is distances
