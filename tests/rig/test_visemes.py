"""Visemes add up to 1, are closed in silence and in p b m, and know every phone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.articulation.crossfade import FADE_S, phone_weights
from lipmotion.rig.shape_names import VISEMES_15
from lipmotion.rig.visemes import VISEME_OF_PHONE, viseme_motion
from lipmotion.types import Span, Timeline, Unit
from lipmotion.units import PHONES
from rig.speech import units


def test_every_phone_has_a_viseme():
    assert set(VISEME_OF_PHONE) == set(PHONES)
    assert set(VISEME_OF_PHONE.values()) == set(VISEMES_15)


def test_silence_and_closures():
    motion = viseme_motion(units(), 201, 100.0)
    assert motion["viseme_sil"][[0, 20, 160, 200]] == pytest.approx([1, 1, 1, 1])
    assert motion["viseme_PP"][[55, 95]] == pytest.approx([1, 1])
    assert motion["viseme_aa"][75] == pytest.approx(1)
    assert motion["viseme_ou"][115] == pytest.approx(1)


@settings(max_examples=25)
@given(
    st.lists(st.tuples(st.sampled_from(PHONES), st.floats(0.0, 0.3), st.floats(0.0, 0.1)), max_size=12),
    st.floats(10, 120),
)
def test_weights_add_up_to_1_and_never_jump(phones, rate_hz):
    spans, end = [], 0.0
    for phone, duration, gap in phones:
        spans.append(Span(end + gap, end + gap + duration, Unit(phone)))
        end += gap + duration
    motion = viseme_motion(Timeline(tuple(spans)), int(rate_hz * (end + 0.5)) + 1, rate_hz)
    np.testing.assert_allclose(motion.values.sum(axis=1), 1, atol=1e-9)
    assert motion.values.min() >= 0
    assert np.abs(np.diff(motion.values, axis=0)).max(initial=0) <= 40 / rate_hz


def test_phones_fade_around_their_border():
    time_s = np.array([0.9 - FADE_S, 0.9 - 0.02, 0.9, 0.9 + 0.02, 0.9 + FADE_S])
    weights = phone_weights(units(), time_s, lambda phone: phone)
    assert weights["p"][2] == pytest.approx(0.5)
    assert weights["aa"][2] == pytest.approx(0.5)
    assert weights["aa"][0] == pytest.approx(1)
    assert 0.5 < weights["aa"][1] < 1


def test_without_units_there_is_silence():
    assert viseme_motion(Timeline(()), 5, 25.0)["viseme_sil"] == pytest.approx(np.ones(5))
