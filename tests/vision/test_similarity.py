from __future__ import annotations

import numpy as np
import pytest

from lipmotion.vision.similarity import face_of, likeness, mouth_of, scene_of, strange_mouths

pytestmark = pytest.mark.video

DRAW = np.random.default_rng(5)
COARSE = DRAW.uniform(40, 215, (9, 12, 3))


@pytest.fixture(autouse=True)
def _opencv():
    pytest.importorskip("cv2")


def picture(scale: int) -> np.ndarray:
    """Squares of many colours, on a grid of 12 by 9."""
    return np.kron(COARSE, np.ones((scale, scale, 1))).astype(np.uint8)


def test_a_scene_is_small_and_its_brightness_does_not_count():
    image = picture(20)
    assert scene_of(image).shape == (24, 32, 3)
    np.testing.assert_allclose(scene_of(image), scene_of(image + np.uint8(30)), atol=1)
    assert abs(scene_of(image).mean()) < 1e-9


def test_a_face_looks_the_same_from_nearer_and_turned():
    far, near = picture(10), picture(30)
    eyes = np.array([[40.0, 40.0], [80.0, 40.0]])
    upright = face_of(far, eyes)
    assert likeness(upright, face_of(near, 3 * eyes)) > 0.95
    turned = np.rot90(far)  # (x, y) to (y, width - x)
    assert likeness(upright, face_of(turned, np.stack([eyes[:, 1], far.shape[1] - eyes[:, 0]], axis=1))) > 0.95
    assert likeness(upright, face_of(far, eyes + np.array([20, 25]))) < 0.6


def test_likeness_is_a_correlation_without_tint():
    one, other = DRAW.uniform(0, 255, (2, 6, 5, 3))
    assert likeness(one, 0.5 * one + (10, 20, 30)) == pytest.approx(1)
    assert likeness(one, 200 - one) == pytest.approx(-1)
    assert likeness(one, np.full_like(one, 90)) == 0
    assert likeness(np.stack([one, other])[:, None], np.stack([one, other])).shape == (2, 2)


def mouths(count: int = 40) -> np.ndarray:
    usual = np.kron(DRAW.uniform(60, 190, (7, 9, 3)), np.ones((8, 8, 1)))
    frames = usual + DRAW.normal(0, 8, (count, *usual.shape))
    return np.stack([mouth_of(frame.clip(0, 255).astype(np.uint8)) for frame in frames])


def test_usual_mouths_are_not_strange():
    assert not strange_mouths(mouths()).any()


@pytest.mark.parametrize("value", [0, 255])
def test_a_box_is_strange(value):
    frames = mouths()
    frames[10:18] = value
    assert np.flatnonzero(strange_mouths(frames)).tolist() == list(range(10, 18))


def test_other_light_is_not_strange():
    frames = mouths()
    frames[10:18] //= 2
    assert not strange_mouths(frames).any()


def test_where_the_usual_look_is_flat_nothing_is_strange():
    frames = np.full((20, 14, 18, 3), 100, np.uint8)
    frames[3] = 250
    assert not strange_mouths(frames).any()
