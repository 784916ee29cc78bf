from __future__ import annotations

import numpy as np
import pytest

from lipmotion_faces.kernels import affine
from oracles import resampling as oracle

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
    assert made[0] == pytest.approx(oracle.resample(picture, to_source, (10, 8), "cubic"), abs=2e-3)


@pytest.mark.parametrize("seed", range(2))
def test_every_blended_pixel_is_that_of_the_definition(seed):
    frame, patch = noise((14, 15, 3), seed), noise((9, 11, 3), seed + 10)
    weight = np.random.default_rng(seed).uniform(0, 1, (9, 11)).astype(np.float32)
    to_patch = random_map(seed, 9) if seed else TURNED
    wanted = oracle.blended(frame[2:12, 3:11], patch, weight, to_patch, "cubic")
    result = frame.copy()
    affine.blend(result, (2, 3), (10, 8), patch, weight, to_patch)
    assert np.abs(result[2:12, 3:11] - wanted).max() <= 0.501
    result[2:12, 3:11] = frame[2:12, 3:11]
    assert (result == frame).all()


def test_any_layout_of_the_arrays_is_accepted():
    picture, frame = noise((20, 20, 3)), noise((30, 40, 3), 1)
    picture.flags.writeable = False
    plain = affine.resample(picture[None], TURNED, (12, 12))
    flipped = affine.resample(picture[None, ::-1].copy()[:, ::-1], TURNED, (12, 12))
    assert (plain == flipped).all()
    assert affine.resample(picture[None].astype(float), TURNED, (12, 12)) == pytest.approx(plain, abs=1e-3)
    weight = np.ones((20, 20))
    wide = np.zeros((30, 80, 3), np.uint8)
    wide[:, ::2] = frame
    affine.blend(wide[:, ::2], (0, 0), (30, 40), picture, weight, TURNED)
    affine.blend(frame, (0, 0), (30, 40), picture, weight, TURNED)
    assert (wide[:, ::2] == frame).all()
    assert not wide[:, 1::2].any()
