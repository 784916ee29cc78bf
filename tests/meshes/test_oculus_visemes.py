"""Visemes add up to 1, are closed in silence and in p b m, and know every phone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.articulation.mouth import spoken_mouth
from lipmotion.articulation.phone_targets import FADE_S, crossfade_phones
from lipmotion.articulation.rest import rest_in_pauses
from lipmotion.meshes.fitting.blendshape_motion import arkit_mouth
from lipmotion.meshes.fitting.shape_weights import (
    MAX_CLOSED_WEIGHT,
    VISEME_OF_PHONE,
    solve_shape_weights,
    weigh_visemes,
)
from lipmotion.meshes.model.shape_names import VISEMES_15
from lipmotion.types import Channel, Generation, Motion, Span, StateTrace, Timeline, Unit
from lipmotion.units import PHONES
from meshes.speech import motion, units


def test_every_phone_has_a_viseme():
    assert set(VISEME_OF_PHONE) == set(PHONES)
    assert set(VISEME_OF_PHONE.values()) == set(VISEMES_15)


def test_silence_and_closures():
    found = weigh_visemes(units(), spoken_mouth(motion(), units()))
    assert found["viseme_sil"][[0, 20, 160, 200]] == pytest.approx([1, 1, 1, 1])
    assert found["viseme_PP"][[55, 95]] == pytest.approx([1, 1])
    assert found["viseme_aa"][75] == pytest.approx(1)
    assert found["viseme_ou"][115] == pytest.approx(1)


@settings(max_examples=25)
@given(
    st.lists(st.tuples(st.sampled_from(PHONES), st.floats(0.0, 0.3), st.floats(0.0, 0.1)), max_size=12),
    st.floats(10, 120),
    st.sampled_from([0.0, 0.03, 0.1, 0.2]),
)
def test_weights_add_up_to_1_and_are_never_negative(phones, rate_hz, opening):
    spans, end = [], 0.0
    for phone, duration, gap in phones:
        spans.append(Span(end + gap, end + gap + duration, Unit(phone)))
        end += gap + duration
    frames = int(rate_hz * (end + 0.5)) + 1
    still = Motion(np.full((frames, 1), opening), rate_hz, (Channel("opening"),))
    said = Timeline(tuple(spans))
    motion = weigh_visemes(said, spoken_mouth(still, said))
    np.testing.assert_allclose(motion.values.sum(axis=1), 1, atol=1e-9)
    assert motion.values.min() >= 0
    closed = motion["viseme_sil"] + motion["viseme_PP"]
    contact = spoken_mouth(still, said).contact
    assert closed[contact] == pytest.approx(1)
    assert closed[~contact].max(initial=0) <= MAX_CLOSED_WEIGHT + 1e-9


def test_phones_fade_around_their_border():
    time_s = np.array([0.9 - FADE_S, 0.9 - 0.02, 0.9, 0.9 + 0.02, 0.9 + FADE_S])
    weights = crossfade_phones(units(), time_s, lambda phone: phone)
    assert weights["p"][2] == pytest.approx(0.5)
    assert weights["aa"][2] == pytest.approx(0.5)
    assert weights["aa"][0] == pytest.approx(1)
    assert 0.5 < weights["aa"][1] < 1


def test_without_units_there_is_silence():
    closed = Motion(np.zeros((5, 1)), 25.0, (Channel("opening"),))
    assert weigh_visemes(Timeline(()), spoken_mouth(closed, Timeline(())))["viseme_sil"] == pytest.approx(np.ones(5))


def test_visemes_rest_where_the_curves_do():
    said = Timeline(tuple(Span(a, b, Unit(p)) for a, b, p in ((0, 0.5, "aa"), (0.5, 1.1, "sp"), (1.1, 1.6, "aa"))))
    held = Motion(np.full((161, 1), 0.1), 100.0, (Channel("opening"),))
    generation = Generation(held, np.zeros((161, 1)), said, StateTrace(("",), np.zeros(161, np.intp)))
    for style, rests in (("rest", True), ("natural", False)):
        moved = rest_in_pauses(generation, style).motion
        found, arkit = weigh_visemes(said, spoken_mouth(moved, said)), solve_shape_weights(moved, said, arkit_mouth())
        assert (found["viseme_sil"][80] > 0.99) == rests
        assert (arkit["jawOpen"][80] < 0.01) == rests
