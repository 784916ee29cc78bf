from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

from lipmotion.speech.sound.sound_offset import (
    FRAME_OFFSETS,
    STATIC_FEATURES,
    measured_opening_speed,
    predicted_opening_speed,
)
from lipmotion.types import Features


def features(seed: int, frames: int = 200) -> Features:
    return Features(np.random.default_rng(seed).normal(size=(frames, 39)).astype(np.float32), frames / 100)


def around(values: np.ndarray, frame: int) -> np.ndarray:
    """Return what the map sees of a frame, slowly."""
    rows = [values[min(max(frame + step, 0), len(values) - 1), :STATIC_FEATURES] for step in FRAME_OFFSETS]
    return np.concatenate(rows)


def test_the_fit_finds_the_map_behind_the_data() -> None:
    weights = np.random.default_rng(9).normal(size=STATIC_FEATURES * len(FRAME_OFFSETS))
    examples = []
    for seed in range(6):
        given = features(seed)
        examples.append((given, np.array([around(given.values, n) @ weights for n in range(200)])))
    script = Path(__file__).parents[2] / "scripts" / "lip_speed.py"
    found = runpy.run_path(str(script))["fit_opening_speed"](examples)
    assert np.corrcoef(found, weights)[0, 1] > 0.995


def test_the_map_that_ships_is_linear_and_local() -> None:
    given = features(1)
    whole = predicted_opening_speed(given)
    assert whole.shape == (200,)
    twice = Features(2 * given.values, given.duration_s)
    assert predicted_opening_speed(twice) == pytest.approx(2 * whole)
    changed = given.values.copy()
    changed[100, :STATIC_FEATURES] += 1
    moved = np.flatnonzero(np.abs(predicted_opening_speed(Features(changed, 2.0)) - whole) > 1e-6)
    assert moved.tolist() == [100 - step for step in reversed(FRAME_OFFSETS)]


def test_speed_is_the_slope() -> None:
    assert measured_opening_speed(0.03 * np.arange(20.0))[3:-3] == pytest.approx(0.03, abs=1e-6)
