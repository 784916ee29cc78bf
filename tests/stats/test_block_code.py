from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline

from lipmotion.errors import InputError
from lipmotion.stats.block_code import BlockCode, BlockLayout, checked_ranges, quantise_blocks


def curves(frames: int, count: int = 3) -> np.ndarray:
    return np.cumsum(np.random.default_rng(frames).normal(0, 1, (frames, count)), axis=0)


def slowly_decoded(code: BlockCode, frame: int) -> np.ndarray:
    """The definition: cosines of a block, then the cubic B-splines around a frame, one number at a time."""
    layout, length = code.layout, code.layout.length
    values = np.zeros((layout.first_blocks[-1] * length, code.count))
    levels = np.concatenate([code.low.astype(float), code.high.astype(float)])
    for (frequency, curve), row in zip(code.used, levels, strict=True):
        gain = 1.0 if layout.spacing <= 1 else (2 + np.cos(np.pi * frequency / length)) / 3
        scale = np.sqrt((1 if frequency == 0 else 2) / length)
        for block, level in enumerate(row):
            for time in range(length):
                cosine = np.cos(np.pi * frequency * (2 * time + 1) / (2 * length))
                values[block * length + time, curve] += scale * cosine * level * code.step / gain
    number = next(n for n, (first, stop) in enumerate(layout.kept) if first <= frame < stop)
    start, offset = layout.first_blocks[number] * length, frame - layout.kept[number, 0]
    if layout.spacing <= 1:
        return values[start + offset]
    knots = np.arange(-3.0, layout.values[number] + 1)
    spline = BSpline(knots, values[start : start + layout.values[number]], 3)
    return spline(offset / layout.spacing)


KEPT = np.array([[2, 40], [40, 41], [50, 95]])


@pytest.mark.parametrize("spacing", [1.0, 4.0, 10 / 3])
@pytest.mark.parametrize("length", [1, 4, 7, 16])
def test_frames_are_decoded_as_defined(spacing: float, length: int) -> None:
    layout = BlockLayout(100, KEPT, spacing, length)
    code = quantise_blocks(layout, layout.forward(curves(100)), 0.2)
    frames = np.array([2, 39, 40, 50, 77, 94])
    assert code.rows(frames) == pytest.approx(np.stack([slowly_decoded(code, frame) for frame in frames]), abs=1e-9)


def test_small_steps_lose_nothing() -> None:
    for length in (1, 5, 32):
        layout = BlockLayout(100, KEPT, 1.0, length)
        code = quantise_blocks(layout, layout.forward(curves(100)), 1e-4)
        frames = np.concatenate([np.arange(*span) for span in KEPT])
        assert code.rows(frames) == pytest.approx(curves(100)[frames], abs=1e-3)


def test_splines_come_back() -> None:
    for spacing, frames in ((4.0, 97), (10 / 3, 101), (100 / 60, 201)):
        knots = np.arange(-3.0, int((frames - 1) / spacing) + 5)
        true = BSpline(knots, curves(len(knots) - 4), 3)(np.arange(frames) / spacing)
        layout = BlockLayout(frames, np.array([[0, frames]]), spacing, 16)
        code = quantise_blocks(layout, layout.forward(true), 1e-3)
        error = np.abs(code.rows(np.arange(frames)) - true)
        assert np.percentile(error, 99) < 0.02 * true.std()
        assert np.median(error) < 0.002 * true.std()


def test_levels_are_as_near_as_the_step_allows() -> None:
    layout = BlockLayout(64, np.array([[0, 64]]), 1.0, 16)
    coefficients = layout.forward(curves(64))
    for step in (0.1, 1.0, 10.0):
        code = quantise_blocks(layout, coefficients, step)
        levels = np.zeros(coefficients.shape)
        levels[:, code.used[:, 0], code.used[:, 1]] = np.concatenate([code.low, code.high]).T
        assert np.abs(levels * step - coefficients).max() <= 0.6 * step * (1 + 1e-5)
        assert np.abs(code.low).max(initial=0) <= 127
        assert (np.abs(code.high).max(axis=1) > 127).all()
        assert (np.abs(code.low).max(axis=1) > 0).all()


def test_too_small_a_step_is_refused() -> None:
    layout = BlockLayout(64, np.array([[0, 64]]), 1.0, 16)
    with pytest.raises(InputError, match="allow a larger error"):
        quantise_blocks(layout, layout.forward(curves(64)), 1e-12)


def test_ranges() -> None:
    assert checked_ranges(None, 5).tolist() == [[0, 5]]
    assert checked_ranges(None, 0).shape == (0, 2)
    assert checked_ranges([], 5).shape == (0, 2)
    assert checked_ranges([(0, 2), (2, 5)], 5).tolist() == [[0, 2], [2, 5]]
    with pytest.raises(InputError, match="overlap"):
        checked_ranges([(0, 3), (2, 5)], 5)
