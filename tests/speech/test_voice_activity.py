from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from lipmotion.speech.sound.voice_activity import (
    LEAST_FRAMES,
    LONGEST_FRAMES,
    MARGIN_FRAMES,
    Stretch,
    stretches_of_sound,
)

QUIET_ENERGY, LOUD_ENERGY = -8.0, 2.0


def energy(frames: int, *sounds: tuple[int, int]) -> np.ndarray:
    """Return a quiet recording with loud frames."""
    values = np.full(frames, QUIET_ENERGY, np.float32)
    for first, end in sounds:
        values[first:end] = LOUD_ENERGY
    return values


def test_sound_has_its_stretch_with_a_margin() -> None:
    (found,) = stretches_of_sound(energy(1000, (300, 500)))
    assert found.first == pytest.approx(300 - MARGIN_FRAMES, abs=5)
    assert found.end == pytest.approx(500 + MARGIN_FRAMES, abs=5)


def test_a_margin_ends_with_the_recording() -> None:
    (found,) = stretches_of_sound(energy(400, (10, 200), (230, 390)))
    assert found == Stretch(0, 400)


def test_short_pauses_do_not_part_sound_and_long_ones_do() -> None:
    assert len(stretches_of_sound(energy(1000, (200, 300), (380, 500)))) == 1
    assert len(stretches_of_sound(energy(1000, (200, 300), (600, 700)))) == 2


def test_clicks_are_no_sound() -> None:
    assert not stretches_of_sound(energy(1000, (300, 300 + LEAST_FRAMES // 3), (600, 602)))


def test_constant_energy_holds_no_stretch() -> None:
    assert stretches_of_sound(np.full(500, -11.5, np.float32)) == []


def test_a_long_stretch_is_cut_where_it_is_quietest() -> None:
    values = energy(5000, (400, 4600))
    values[1000:1030] = -1.0
    first, second, *_ = stretches_of_sound(values)
    assert 1000 <= first.end <= 1030
    assert second.first == first.end


def test_stretches_are_in_order_bounded_and_hold_all_sound() -> None:
    for seed in range(0, 30, 5):
        draw = np.random.default_rng(seed)
        frames = int(draw.integers(2, 9000))
        starts = np.sort(draw.integers(0, frames, draw.integers(1, 30)))
        sounds = [(int(start), int(start + draw.integers(1, 900))) for start in starts]
        values = energy(frames, *sounds) + draw.normal(0, 0.1, frames).astype(np.float32)
        found = stretches_of_sound(values)
        assert all(0 <= stretch.first < stretch.end <= frames for stretch in found)
        assert all(stretch.end - stretch.first <= LONGEST_FRAMES for stretch in found)
        assert all(before.end <= after.first for before, after in pairwise(found))
        inside = np.zeros(frames, bool)
        for stretch in found:
            inside[slice(*stretch)] = True
        loud = values > (QUIET_ENERGY + LOUD_ENERGY) / 2
        middle = np.convolve(loud, np.ones(41), "same") > 40  # all around it is loud
        if np.quantile(values, 0.1) < QUIET_ENERGY + 1 and loud.mean() > 0.1:
            assert inside[middle].all()
