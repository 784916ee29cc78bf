from __future__ import annotations

import numpy as np
import pytest

from lipmotion.speech.sound.pauses import QUIETEST_DB, levels_db, levels_db_at, quietest_s, spoken_spans
from lipmotion.types import Audio

RATE = 16_000


def spoken(spans: list[tuple[float, float]], duration_s: float, *, gain: float = 0.1, noise: float = 1e-3) -> Audio:
    """Return noise that is loud in some spans."""
    draw = np.random.default_rng(0)
    samples = noise * draw.normal(size=round(duration_s * RATE))
    for start_s, end_s in spans:
        part = slice(round(start_s * RATE), round(end_s * RATE))
        samples[part] += gain * draw.normal(size=len(samples[part]))
    return Audio(samples.astype(np.float32), RATE)


SPANS = [(0.5, 1.5), (2.0, 3.2), (4.0, 4.6)]


def test_levels_are_those_of_the_sound():
    sine = np.sin(2 * np.pi * 440 * np.arange(RATE) / RATE).astype(np.float32)
    levels = levels_db(Audio(0.1 * sine, RATE))
    assert levels.shape == (100,)
    assert levels[10:-10] == pytest.approx(-23.0, abs=0.3)  # 20 dB below full scale, 3 for a sine
    assert levels_db(Audio(np.zeros(RATE, np.float32), RATE)).tolist() == [-100.0] * 100


def test_spans_between_pauses():
    found = spoken_spans(levels_db(spoken(SPANS, 5.0)))
    np.testing.assert_allclose(found, SPANS, atol=0.04)


def test_short_dips_do_not_divide_and_clicks_are_not_speech():
    found = spoken_spans(levels_db(spoken([(0.5, 1.0), (1.12, 1.5), (2.5, 2.53)], 4.0)))
    np.testing.assert_allclose(found, [(0.5, 1.5)], atol=0.04)


def test_loudness_may_change_in_an_hour():
    loud, soft = spoken(SPANS * 1, 60.0, gain=0.2, noise=1e-2), spoken(SPANS, 60.0, gain=0.004, noise=1e-4)
    both = Audio(np.concatenate([loud.samples, soft.samples]), RATE)
    found = spoken_spans(levels_db(both))
    expected = [*SPANS, *((start_s + 60, end_s + 60) for start_s, end_s in SPANS)]
    np.testing.assert_allclose([span for span in found if span[0] % 60 < 5], expected, atol=0.05)


def test_the_quietest_place():
    levels = levels_db(spoken([(0.0, 1.0), (1.1, 2.0)], 2.0))
    assert quietest_s(levels, 0.5, 1.8) == pytest.approx(1.05, abs=0.06)
    assert quietest_s(levels, 1.0, 1.0) == pytest.approx(1.0)


def test_levels_at_any_time():
    sound = spoken(SPANS, 5.0)
    levels, times_s = levels_db(sound), np.array([-1.0, 0.005, 1.005, 1.01, 99.0])
    found = levels_db_at(sound, times_s)
    assert found == pytest.approx([levels[0], levels[0], levels[100], levels[100:102].mean(), levels[-1]])


def test_sound_of_less_than_a_step_is_quiet():
    for samples in (0, 159):
        found = levels_db_at(Audio(np.ones(samples, np.float32), RATE), np.arange(3.0))
        assert found == pytest.approx([QUIETEST_DB] * 3)
