from types import SimpleNamespace

import numpy as np
import pytest

from lipmotion_faces.kernels import affine, painting
from oracles import drawing

WITHOUT_NUMBA = SimpleNamespace(
    paint_band=painting.paint_band, warp=painting.warp_arrays, stack=painting.stack_arrays,
    warp_bytes=lambda source, *rest: painting.warp_packed_arrays(source.view(np.uint64)[..., 0], *rest),
)  # fmt: skip


def band(rng: np.random.Generator, width: int) -> tuple[np.ndarray, ...]:
    top = np.sort(rng.uniform(-3, 15, (4, width)), axis=0)
    bottom = top + rng.uniform(-2, 8, (4, width))
    texture = rng.uniform(0, 255, (5, 7, 4)) * (1, 1, 1, 1 / 255)
    return top, np.maximum(bottom, top), np.linspace(0, 1, width), texture


def counted(top: np.ndarray, bottom: np.ndarray, height: int, fine: int = 400) -> np.ndarray:
    """Return the cover by counting ``fine`` points down each pixel."""
    points = (np.arange(height * fine) + 0.5) / fine
    hit = (points[:, None, None] >= top) & (points[:, None, None] < bottom)
    return hit.mean(axis=1).reshape(height, fine, -1).mean(axis=1)


def test_cover_is_that_of_counted_points():
    rng = np.random.default_rng(1)
    top, bottom, across, _ = band(rng, 9)
    layer = np.zeros((16, 9, 4), np.float32)
    painting.paint_band(layer, top, bottom, across, np.array([[[100.0, 100, 100, 1]]]))
    assert layer[..., 0] / 100 == pytest.approx(counted(top, bottom, 16), abs=0.01)
    assert layer[..., 3] == pytest.approx(layer[..., 0] / 100, abs=1e-5)


def test_a_shift_by_whole_pixels_moves_the_picture_and_half_a_pixel_is_the_mean_of_two():
    source = np.random.default_rng(2).integers(0, 256, (12, 10, 4), np.uint16)
    target = np.empty((12, 10, 4), np.uint8)
    painting.warp_bytes(source, np.full((4, 4), 2.0), np.full((4, 4), -1.0), 4, target)
    assert np.array_equal(target[1:, :7], source[:-1, 2:9])
    assert np.abs(target[1:, 8:].astype(int) - source[:-1, 9:]).max() <= 1  # the last pixels go on
    ramp = np.arange(30, dtype=np.float32).reshape(5, 6, 1)
    halved = np.empty_like(ramp)
    painting.warp(ramp, np.full((3, 3), 0.5), np.zeros((3, 3)), 4, halved)
    assert halved[:, :5, 0] == pytest.approx((ramp[:, :5, 0] + ramp[:, 1:, 0]) / 2)


@pytest.mark.parametrize("seed", range(2))
def test_every_bit_is_that_of_the_definition(seed):
    results = []
    for form in (painting, WITHOUT_NUMBA):
        rng = np.random.default_rng(seed)
        layer = rng.uniform(0, 1, (16, 23, 4)).astype(np.float32)
        form.paint_band(layer, *band(rng, 23))
        bytes_in = rng.integers(0, 256, (17, 23, 4), np.uint16)
        shifts = rng.normal(0, 3, (2, 6, 7))
        floats, few = np.empty((16, 23, 4), np.float32), np.empty((17, 23, 3), np.uint8)
        form.warp(layer, *shifts, 4, floats)
        form.warp_bytes(bytes_in, *shifts, 4, few)
        layers = [
            (rng.uniform(0, 60, (64, 96, depth)) * [1, 1, 1, 1 / 60, 1 / 60][:depth]).astype(np.float32)
            for depth in (4, 4, 5, 4)
        ]
        stacked = np.empty((64, 96, 4), np.uint16)
        form.stack(*layers, stacked)
        results.append((layer, floats, few, stacked))
    for found, wanted, levels in zip(*results, (0, 0, 3, 0), strict=True):
        np.testing.assert_allclose(found, wanted.astype(float), rtol=0, atol=levels, equal_nan=False)


TURNED = np.array([[0.7, -0.1, 2.3], [0.12, 0.68, -3.6]])


def noise(shape: tuple[int, ...], seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, shape, np.uint8)


def random_map(seed: int, size: int) -> np.ndarray:
    """Return a map of any turn, scale, shear and shift, which also leads far out of a picture."""
    draw = np.random.default_rng(seed)
    return np.column_stack([draw.normal(0, 1, (2, 2)), draw.uniform(-size, 2 * size, 2)])


@pytest.mark.parametrize("seed", range(2))
def test_every_pixel_is_that_of_the_definition(seed):
    picture, to_source = noise((9, 13, 3), seed), random_map(seed, 9) if seed else TURNED
    made = affine.resample(picture[None], to_source, (10, 8))
    assert made.dtype == np.float32
    assert made[0] == pytest.approx(drawing.resample(picture, to_source, (10, 8), "cubic"), abs=2e-3)


@pytest.mark.parametrize("seed", range(2))
def test_every_blended_pixel_is_that_of_the_definition(seed):
    frame, patch = noise((14, 15, 3), seed), noise((9, 11, 3), seed + 10)
    weight = np.random.default_rng(seed).uniform(0, 1, (9, 11)).astype(np.float32)
    to_patch = random_map(seed, 9) if seed else TURNED
    wanted = drawing.blended(frame[2:12, 3:11], patch, weight, to_patch, "cubic")
    result = frame.copy()
    affine.blend(result, (2, 3), (10, 8), patch, weight, to_patch)
    assert np.abs(result[2:12, 3:11] - wanted).max() <= 0.501
    result[2:12, 3:11] = frame[2:12, 3:11]
    assert (result == frame).all()
