"""Movements as large as the original's."""

import numpy as np
import pytest

from lipmotion.engines import engine_named
from lipmotion.kernels.banded import solve_mlpg
from lipmotion.motion.variance_scaling import LARGEST_FACTOR, VarianceScaling
from lipmotion.testing.examples import examples, speech, timeline
from lipmotion.types import Constraints, Pin
from lipmotion.types.progress import silent_monitor

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
