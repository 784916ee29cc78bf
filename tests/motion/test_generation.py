"""Long recordings are generated block by block."""

from dataclasses import replace

import numpy as np
import pytest

from lipmotion.engines import engine_named
from lipmotion.motion import generation as module
from lipmotion.motion.closure import find_closable_ranges
from lipmotion.motion.modulation_filter import REACH, ModulationFilter
from lipmotion.testing.examples import PHONES, examples, speech, timeline
from lipmotion.types import Constraints, Pin
from lipmotion.types.progress import silent_monitor

ENGINE = engine_named("trajectory", {})
MODEL = ENGINE.fit(examples(), silent_monitor).model
SPOKEN = speech(timeline(["sil", *(list(PHONES) * 30)[:40], "sil"]), seed=5)


@pytest.fixture
def whole():
    return ENGINE.generate(MODEL, SPOKEN, Constraints((Pin(3.3, "opening", 0.2), Pin(5.01, "opening", 0.1))))


@pytest.mark.parametrize("frames_per_block", [97])
def test_blocks_change_nothing(whole, frames_per_block, monkeypatch):
    frames = len(SPOKEN.features.values)
    assert frames > 3 * frames_per_block
    monkeypatch.setattr(module, "BLOCK_FRAMES", frames_per_block)
    monkeypatch.setattr(module, "MARGIN_FRAMES", 250)
    pins = Constraints((Pin(3.3, "opening", 0.2), Pin(5.01, "opening", 0.1)))
    pieces = ENGINE.generate(MODEL, SPOKEN, pins)
    assert pieces.motion.values == pytest.approx(
        whole.motion.values, abs=1e-7
    )  # the acoustic regression is computed in single precision
    assert pieces.variance == pytest.approx(whole.variance, abs=1e-9)
    assert np.array_equal(pieces.trace.frames, whole.trace.frames)
    assert pieces.motion["opening"][330] == 0.2


def test_a_long_recording_is_kept_in_single_precision(whole, monkeypatch):
    monkeypatch.setattr(module, "DOUBLE_FRAMES", 10)
    single = ENGINE.generate(MODEL, SPOKEN, Constraints((Pin(3.3, "opening", 0.2), Pin(5.01, "opening", 0.1))))
    assert single.motion.values.dtype == single.variance.dtype == np.float32
    assert single.motion.values == pytest.approx(whole.motion.values, abs=1e-5)
    assert single.variance == pytest.approx(whole.variance, abs=1e-6)
    assert single.spread.reduced.shape == (len(SPOKEN.features.values), MODEL.space.dimensions)


def test_the_filter_is_weaker_for_voices_that_are_less_known():
    taps = np.zeros((2 * REACH + 1, MODEL.space.dimensions))
    taps[REACH - 1 : REACH + 2] = np.array([-1.0, 3.0, -1.0])[:, None]
    learned = replace(MODEL.motion, modulation=ModulationFilter(taps))
    assert learned.for_voice(1.0).modulation.taps == pytest.approx(taps)
    assert replace(learned, modulation=None).for_voice(0.3).modulation is None
    sides = learned.for_voice(0.75).modulation.taps[REACH + 1]  # unseen_share: one half
    width = MODEL.space.direct_names.index("width")
    assert sides[width] == pytest.approx(-0.25)
    assert np.delete(sides, width) == pytest.approx(-0.5)
    unknown = learned.for_voice(0.0).modulation.taps
    assert unknown[REACH] == pytest.approx(1)
    assert np.abs(unknown).sum(axis=0) == pytest.approx(1)


def test_the_modulation_filter_keeps_pins_closures_and_blocks(monkeypatch):
    taps = np.zeros((2 * REACH + 1, MODEL.space.dimensions))
    taps[REACH - 3 : REACH + 4 : 3] = np.array([-0.5, 2.0, -0.5])[:, None]  # sharpens
    model = replace(MODEL, modulation=ModulationFilter(taps))
    pins = Constraints((Pin(3.3, "opening", 0.2),))
    filtered = ENGINE.generate(model, SPOKEN, pins).motion["opening"]
    plain = ENGINE.generate(MODEL, SPOKEN, pins).motion["opening"]
    assert np.abs(np.diff(filtered, 3)).mean() > 1.5 * np.abs(np.diff(plain, 3)).mean()
    assert filtered[330] == 0.2
    assert filtered.min() >= 0
    ranges = find_closable_ranges(SPOKEN.units, len(filtered))
    assert len(ranges) > 5
    for each in ranges:
        assert filtered[each].min() <= plain[each].min()
    monkeypatch.setattr(module, "BLOCK_FRAMES", 97)
    monkeypatch.setattr(module, "MARGIN_FRAMES", 250)
    assert ENGINE.generate(model, SPOKEN, pins).motion["opening"] == pytest.approx(filtered, abs=1e-7)
