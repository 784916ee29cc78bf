"""Long recordings are generated block by block."""

import numpy as np
import pytest

from lipmotion.engines import engine_named
from lipmotion.motion import generation as module
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
