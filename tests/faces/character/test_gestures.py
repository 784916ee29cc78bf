import numpy as np
import pytest

from faces.character.motions import said
from lipmotion.faces.character.gestures import GESTURES, Gesture, pause_weight
from lipmotion.units import PHONES

TIME_S = np.arange(0, 1.6, 0.01)


def test_a_gesture_is_full_in_its_phone_and_nothing_away_from_it():
    weight = Gesture({"f": 1.0}).weight(said("ah", "f", "ah"), TIME_S)
    assert weight[60] == pytest.approx(1)
    assert weight[[20, 100]] == pytest.approx([0, 0])
    assert weight[40] == pytest.approx(0.5, abs=0.01)


def test_a_gesture_goes_on_between_two_of_its_phones():
    weight = Gesture({"f": 1.0, "v": 1.0}).weight(said("f", "v"), TIME_S)
    assert weight[10:70] == pytest.approx(np.ones(60))


def test_rounding_begins_before_the_phone():
    early, exact = (Gesture({"uw": 1.0}, 0.1, early_s=early_s).weight(said("t", "uw"), TIME_S) for early_s in (0.05, 0))
    assert early[37] > exact[37] + 0.2


def test_a_pause_of_the_lips_begins_later_than_that_of_the_sound():
    weight = pause_weight(said("aa", "sil", "aa"), TIME_S)
    assert weight[40] < 0.1
    assert weight[55] == pytest.approx(1)
    assert weight[78] < 0.1


def test_all_phones_of_the_tables_exist():
    assert {phone for each in GESTURES.values() for phone in each.strengths} <= set(PHONES)
