"""Silence away from speech."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lipmotion.motion.rest import find_digital_silence, is_away_from_speech, list_speech_intervals
from lipmotion.testing.examples import timeline
from lipmotion.types import ENERGY_FEATURE


@given(edges=st.lists(st.integers(0, 400), max_size=12, unique=True), margin=st.integers(0, 40))
def test_it_is_farther_than_the_margin_from_every_interval(edges: list[int], margin: int) -> None:
    edges = sorted(edges)[: len(edges) // 2 * 2]
    speech = list(zip(edges[::2], edges[1::2], strict=True))
    times = np.arange(400, dtype=float) + 0.5
    wanted = np.ones(400, bool)
    for start, end in speech:
        wanted &= (times < start - margin) | (times > end + margin)
    assert is_away_from_speech(times, speech, float(margin)).tolist() == wanted.tolist()


def test_intervals_are_those_of_phones() -> None:
    units = timeline(("t", "aa"))
    assert list_speech_intervals(units) == [(0.6, 0.7), (0.7, 0.8)]
    away = is_away_from_speech(np.array([0.0, 0.2, 0.45, 0.65, 1.0, 1.2]), list_speech_intervals(units), 0.3)
    assert away.tolist() == [True, True, False, False, False, True]
    assert is_away_from_speech(np.arange(3.0), [], 1.0).all()


def test_the_mouth_rests_in_digital_silence_of_some_length() -> None:
    features = np.full((200, ENERGY_FEATURE + 1), 3.0)
    for first, stop in ((5, 10), (20, 24), (50, 62), (75, 90)):  # 50 ms, 40 ms, beside speech, in speech
        features[first:stop, ENERGY_FEATURE] = -9.0
    features[30:40, ENERGY_FEATURE] = -8.9  # a breath
    silent = find_digital_silence(features, timeline(("t", "aa", "t")))
    assert np.flatnonzero(silent).tolist() == [*range(5, 10), *range(50, 55)]
