"""What is detected beside words, from the sound to the motion that files hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lipmotion import Model, animate
from lipmotion.articulation.rest import LAUGH_GAP
from lipmotion.pipeline.outputs.deliver import deliver
from lipmotion.pipeline.request import Request
from lipmotion.types import Delivery
from lipmotion.types.voice_event import LAUGHTER
from speech.made_voices import laugh, pulses, recording, said, vowels


@pytest.fixture(scope="module")
def request_with_laughter() -> Request:
    audio = recording((0.5, vowels(pulses(1.0, 120))), (2.0, laugh(6)))
    return Request(audio, units=said(audio.duration_s, (0.5, 1.5)))


def test_a_face_laughs_where_laughter_is_detected(toy_model: Model, request_with_laughter: Request):
    laughing = animate(request_with_laughter, model=toy_model)
    (event,) = laughing.events
    assert event.kind == LAUGHTER
    opening = laughing.motion["opening"]
    loudest_s = max(event.calls, key=lambda call: call[1])[0]
    assert opening[round(loudest_s * 100)] == pytest.approx(LAUGH_GAP, rel=0.1)
    happy = deliver(laughing, Delivery()).motion["mood_happy"]
    assert happy[round(loudest_s * 100)] > 0.7
    assert not happy[:150].any()
    assert "mood_happy" not in deliver(laughing, Delivery(mood="neutral")).motion.names


def test_what_is_detected_changes_nothing_where_it_is_not_asked_for(toy_model: Model, request_with_laughter: Request):
    plain = animate(replace(request_with_laughter, manner="asked"), model=toy_model)
    laughing = animate(request_with_laughter, model=toy_model)
    assert not plain.events
    assert plain.motion["opening"][200:].max() < 0.05
    assert np.array_equal(plain.motion.values[50:150], laughing.motion.values[50:150])
