"""The modulation filter as an option of every engine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lipmotion.engines import Engine, engine_named
from lipmotion.errors import ModelFormatError
from lipmotion.testing.examples import examples, speech, timeline
from lipmotion.types import silent_monitor

PLAIN = {"articulation": False, "closures": False, "components": 1}
OPTIONS = {
    "coupled": {"chains": "2vis 2vis", "mixtures": 1, "asynchrony": 0, "states": 1, "acoustic_regression": False},
    "joint": {"units": "2vis", "mixtures": 1, "states": 1},
    "selection": {"joint_recogniser": False, "guide": 0.0, "candidates": 5, "beam": 3},
    "trajectory": {"units": "2vis", "states": 1, "silent_states": 1, "acoustic_regression": False, "conditions": 0},
}
SPOKEN = speech(timeline(("aa", "iy", "t", "uw", "s", "aa")))


NAMES = [pytest.param(name, marks=[pytest.mark.long] * (name == "selection")) for name in OPTIONS]
"""Recorded units are compressed, which takes a second."""


@pytest.mark.parametrize("name", NAMES)
def test_it_is_learned_and_stored_and_unknown_voices_do_without(name: str) -> None:
    engine: Engine = engine_named(name, {**PLAIN, **OPTIONS[name], "modulation_filter": 1.0})
    model = engine.fit(examples(4), silent_monitor).model
    arrays = engine.to_arrays(model)
    taps = arrays.pop("modulation")
    assert taps.sum(axis=0) == pytest.approx(1)
    off = engine_named(name, {**PLAIN, **OPTIONS[name], "modulation_filter": 0.0})
    plain, again = off.from_arrays(arrays), engine.from_arrays({**arrays, "modulation": taps})
    with pytest.raises(ModelFormatError):
        engine.from_arrays(arrays)

    def opening(learned: object, voice: float) -> np.ndarray:
        return engine.generate(learned, replace(SPOKEN, voice=voice)).motion["opening"]

    assert opening(again, 1.0) == pytest.approx(opening(model, 1.0), abs=2e-3)  # half precision
    assert np.abs(opening(again, 1.0) - opening(plain, 1.0)).max() > 1e-4
    assert opening(again, 0.0) == pytest.approx(opening(plain, 0.0), abs=1e-12)
    assert "modulation" not in engine.to_arrays(plain)
