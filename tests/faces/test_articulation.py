import numpy as np
import pytest

from lipmotion.faces.portrait.articulation import BLEND_S, TIP_RAISES, TUCKS, gesture_weight
from lipmotion.types import Span, Timeline, Unit


def timeline(*spans: tuple[float, float, str]) -> Timeline[Unit]:
    return Timeline(tuple(Span(start, end, Unit(phone)) for start, end, phone in spans))


def test_a_gesture_is_half_made_at_the_boundaries_of_its_phone():
    made = gesture_weight(timeline((0.2, 0.4, "f")), TUCKS, np.array([0.2, 0.3, 0.4]))
    assert made == pytest.approx([0.5, 1.0, 0.5])


def test_a_gesture_is_over_outside_its_blend():
    made = gesture_weight(timeline((0.2, 0.4, "f")), TUCKS, np.array([0.0, 0.2 - BLEND_S / 2, 0.4 + BLEND_S / 2, 1.0]))
    assert made == pytest.approx([0, 0, 0, 0])


def test_neighbouring_phones_of_one_gesture_run_together():
    time_s = np.linspace(0.3, 0.5, 41)
    assert gesture_weight(timeline((0.2, 0.4, "f"), (0.4, 0.6, "v")), TUCKS, time_s) == pytest.approx(np.ones(41))


def test_it_moves_smoothly():
    time_s = np.arange(0, 1, 0.01)
    made = gesture_weight(timeline((0.2, 0.4, "th"), (0.4, 0.6, "aa"), (0.6, 0.8, "d")), TIP_RAISES, time_s)
    assert np.abs(np.diff(made)).max() < 0.3
    assert made.max() == pytest.approx(1)
    assert made[70] == pytest.approx(0.4)


def test_nothing_without_phones():
    assert not gesture_weight(Timeline(()), TUCKS, np.arange(5) / 25).any()
