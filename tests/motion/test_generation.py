from dataclasses import replace

import numpy as np
import pytest

from lipmotion.engines import engine_named
from lipmotion.kernels.banded import solve_mlpg
from lipmotion.motion import generation as module
from lipmotion.motion.closure import find_closable_ranges
from lipmotion.motion.generation import LARGEST_FACTOR, VarianceScaling
from lipmotion.motion.modulation_filter import REACH, ModulationFilter
from lipmotion.testing import PHONES, examples, speech, timeline
from lipmotion.types import Constraints, Pin, silent_monitor

ENGINE = engine_named("trajectory", {})
MODEL = ENGINE.fit(examples(), silent_monitor).model
SPOKEN = speech(timeline(["sil", *(list(PHONES) * 30)[:40], "sil"]), seed=5)


PINS = Constraints((Pin(3.3, "opening", 0.2), Pin(5.01, "opening", 0.1)))


@pytest.fixture
def in_blocks(monkeypatch):
    monkeypatch.setattr(module, "BLOCK_FRAMES", 97)
    monkeypatch.setattr(module, "MARGIN_FRAMES", 250)
    assert len(SPOKEN.features.values) > 3 * 97


def around(taps):
    """Return a filter of these taps in all dimensions."""
    reach = len(taps) // 2
    values = np.zeros((2 * REACH + 1, MODEL.space.dimensions))
    values[REACH - reach : REACH + reach + 1] = np.array(taps)[:, None]
    return ModulationFilter(values)


@pytest.fixture(scope="module")
def whole():
    return ENGINE.generate(MODEL, SPOKEN, PINS)


@pytest.mark.usefixtures("in_blocks")
def test_blocks_change_nothing(whole):
    pieces = ENGINE.generate(MODEL, SPOKEN, PINS)
    assert pieces.motion.values == pytest.approx(whole.motion.values, abs=1e-7)  # a regression of single precision
    assert pieces.variance == pytest.approx(whole.variance, abs=1e-9)
    assert np.array_equal(pieces.trace.frames, whole.trace.frames)
    assert pieces.motion["opening"][330] == 0.2


def test_a_long_recording_is_kept_in_single_precision(whole, monkeypatch):
    monkeypatch.setattr(module, "DOUBLE_FRAMES", 10)
    single = ENGINE.generate(MODEL, SPOKEN, PINS)
    assert single.motion.values.dtype == single.variance.dtype == np.float32
    assert single.motion.values == pytest.approx(whole.motion.values, abs=1e-5)
    assert single.variance == pytest.approx(whole.variance, abs=1e-6)
    assert single.spread.reduced.shape == (len(SPOKEN.features.values), MODEL.space.dimensions)


def test_the_filter_is_weaker_for_voices_that_are_less_known():
    learned = replace(MODEL.motion, modulation=around([-1.0, 3.0, -1.0]))
    assert learned.for_voice(1.0).modulation.taps == pytest.approx(learned.modulation.taps)
    assert replace(learned, modulation=None).for_voice(0.3).modulation is None
    sides = learned.for_voice(0.75).modulation.taps[REACH + 1]  # unseen_share: one half
    width = MODEL.space.direct_names.index("width")
    assert sides[width] == pytest.approx(-0.25)
    assert np.delete(sides, width) == pytest.approx(-0.5)
    unknown = learned.for_voice(0.0).modulation.taps
    assert unknown[REACH] == pytest.approx(1)
    assert np.abs(unknown).sum(axis=0) == pytest.approx(1)


def test_the_modulation_filter_keeps_pins_closures_and_blocks(request, whole):
    model = replace(MODEL, modulation=around([-0.5, 0, 0, 2.0, 0, 0, -0.5]))  # sharpens
    filtered, plain = ENGINE.generate(model, SPOKEN, PINS).motion["opening"], whole.motion["opening"]
    assert np.abs(np.diff(filtered, 3)).mean() > 1.5 * np.abs(np.diff(plain, 3)).mean()
    assert filtered[330] == 0.2
    assert filtered.min() >= 0
    ranges = find_closable_ranges(SPOKEN.units, len(filtered))
    assert len(ranges) > 5
    for each in ranges:
        assert filtered[each].min() <= plain[each].min()
    request.getfixturevalue("in_blocks")
    assert ENGINE.generate(model, SPOKEN, PINS).motion["opening"] == pytest.approx(filtered, abs=1e-7)


OPTIONS = {"articulation": False, "states": 3, "silent_states": 7, "components": 2, "acoustic_components": 20}


def test_the_trajectory_grows_about_rest_and_its_variance_with_it():
    draw = np.random.default_rng(0)
    means, precisions = draw.normal(size=(40, 3, 2)), draw.uniform(1, 9, (40, 3, 2))
    gain, rest = np.array([1.5, 1.0]), np.array([0.3, -1.0])
    plain, variance = solve_mlpg(means, precisions)
    large, larger_variance = solve_mlpg(*VarianceScaling(gain, rest).apply(means, precisions))
    assert large == pytest.approx(rest + gain * (plain - rest))
    assert larger_variance == pytest.approx(variance * gain * gain)


@pytest.fixture(scope="module")
def noisy():
    """Clips in which every phone is said more or less wide, so that the mean of all is too small a movement."""
    corpus = examples(10)
    for number, one in enumerate(corpus):
        waves = np.sin(np.arange(len(one.valid)) / (3 + number % 4)) * 0.02
        one.motion.values[60:-60, 0] += waves[60:-60]
    return corpus


@pytest.mark.long
def test_the_full_range_is_nearer_to_the_original(noisy):
    engines = [
        engine_named("trajectory", {**OPTIONS, "variance_scaling": on, "closures": False}) for on in (False, True)
    ]
    learned = engines[0].fit(noisy, silent_monitor).model
    assert 1 < learned.variance_factors[0] <= LARGEST_FACTOR
    spreads = [
        np.mean([engine.generate(learned, one.speech).motion["opening"].std() for one in noisy]) for engine in engines
    ]
    original = np.mean([one.motion["opening"].std() for one in noisy])
    assert spreads[0] < spreads[1]
    assert abs(spreads[1] - original) < abs(spreads[0] - original)


def test_pins_and_rest_stay_where_they_are(noisy):
    engine = engine_named("trajectory", OPTIONS)
    learned = engine.fit(noisy, silent_monitor).model
    result = engine.generate(learned, speech(timeline(("t", "aa", "s"))), Constraints((Pin(0.8, "width", 0.61),)))
    assert result.motion["width"][80] == 0.61
    rest = learned.emission.means[-1, 0, 0]
    assert result.motion["opening"][:20] == pytest.approx(np.full(20, rest), abs=2e-3)
