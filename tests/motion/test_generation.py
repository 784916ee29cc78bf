from dataclasses import replace

import numpy as np
import pytest

from lipmotion import types
from lipmotion.engines import engine_named
from lipmotion.kernels.banded import solve_mlpg
from lipmotion.motion import generation as module
from lipmotion.motion.closure import find_closable_ranges
from lipmotion.motion.modulation_filter import REACH, ModulationFilter
from lipmotion.motion.variance_scaling import LARGEST_FACTOR, VarianceScaling
from lipmotion.testing import PHONES, examples, speech, timeline
from lipmotion.types import Constraints, Pin, silent_monitor

ENGINE = engine_named("trajectory", {})
MODEL = ENGINE.fit(examples(), silent_monitor).model
SPOKEN = speech(timeline(["sil", *(list(PHONES) * 30)[:40], "sil"]), seed=5)


PINS = Constraints((Pin(3.3, "opening", 0.2), Pin(5.01, "opening", 0.1)))


BEFORE = 5750
"""Frames of silence after which the sentence lies on the border of two blocks."""


def delayed():
    """Return the sentence and its pins after as much silence that it lies in two blocks."""
    assert BEFORE < module.BLOCK_FRAMES < BEFORE + 330
    units = types.Timeline((types.Span(0.0, BEFORE / 100, types.Unit("sil")), *SPOKEN.units.shifted(BEFORE / 100)))
    late = speech(units)
    values = np.concatenate([late.features.values[:BEFORE], SPOKEN.features.values])
    pins = Constraints(tuple(replace(pin, time_s=pin.time_s + BEFORE / 100) for pin in PINS.pins))
    return replace(late, features=replace(late.features, values=values)), pins


def around(taps):
    """Return a filter of these taps in all dimensions."""
    reach = len(taps) // 2
    values = np.zeros((2 * REACH + 1, MODEL.space.dimensions))
    values[REACH - reach : REACH + reach + 1] = np.array(taps)[:, None]
    return ModulationFilter(values)


@pytest.fixture(scope="module")
def whole():
    return ENGINE.generate(MODEL, SPOKEN, PINS)


def test_blocks_change_nothing(whole):
    pieces, away = ENGINE.generate(MODEL, *delayed()), slice(100, None)
    moved = pieces.motion.values[BEFORE:]
    assert moved[away] == pytest.approx(whole.motion.values[away], abs=1e-7)  # a regression of single precision
    assert pieces.variance[BEFORE:][away] == pytest.approx(whole.variance[away], abs=1e-9)
    assert pieces.motion["opening"][BEFORE + 330] == 0.2
    names = [[each.trace.states[state] for state in each.trace.frames] for each in (pieces, whole)]
    assert names[0][BEFORE:][away] == names[1][away]


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


def test_the_modulation_filter_keeps_pins_closures_and_blocks(whole):
    model = replace(MODEL, modulation=around([-0.5, 0, 0, 2.0, 0, 0, -0.5]))  # sharpens
    filtered, plain = ENGINE.generate(model, SPOKEN, PINS).motion["opening"], whole.motion["opening"]
    assert np.abs(np.diff(filtered, 3)).mean() > 1.5 * np.abs(np.diff(plain, 3)).mean()
    assert filtered[330] == 0.2
    assert filtered.min() >= 0
    ranges = find_closable_ranges(SPOKEN.units, len(filtered))
    assert len(ranges) > 5
    for each in ranges:
        assert filtered[each].min() <= plain[each].min()
    assert ENGINE.generate(model, *delayed()).motion["opening"][BEFORE + 100 :] == pytest.approx(
        filtered[100:], abs=1e-7
    )


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
