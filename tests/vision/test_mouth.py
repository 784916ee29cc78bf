from __future__ import annotations

import numpy as np
import pytest

from lipmotion.vision.mouth import mouth_crop, region_to_image

pytestmark = pytest.mark.video
cv2 = pytest.importorskip("cv2")


def ramp(width: int, height: int) -> np.ndarray:
    """Red rises to the right and green downwards, one a pixel centre."""
    image = np.zeros((height, width, 3), np.uint8)
    image[..., 0] = np.arange(width)
    image[..., 1] = np.arange(height)[:, None]
    return image


def test_an_upright_face_of_the_right_size_is_cut_out_as_it_is():
    eyes = np.array([[60.0, 50.0], [150.0, 50.0]])  # 90 px apart, the middle at 105, 50
    image = ramp(256, 200)
    np.testing.assert_array_equal(mouth_crop(image, eyes), image[98 : 98 + 56, 69 : 69 + 72])


def test_the_eyes_of_the_turned_head_become_level():
    angle = np.deg2rad(20)
    half = 45 * np.array([np.cos(angle), np.sin(angle)])
    crop = mouth_crop(ramp(256, 200), np.array([130, 80]) + np.stack([-half, half]))
    along = np.diff(crop[28].astype(int), axis=0).mean(axis=0)
    np.testing.assert_allclose(along[:2], [np.cos(angle), np.sin(angle)], atol=0.03)


def test_region_pixels_map_to_the_head():
    eyes = np.array([[10.0, 20.0], [28.0, 20.0]])  # 18 px: five region pixels to one of the image
    matrix = region_to_image(eyes)
    # the centre of the region, (36, 28) from its corner, lies (0, 76) from between the eyes
    centre = matrix @ [35.5, 27.5, 1]
    np.testing.assert_allclose(centre + 0.5, [19, 20 + 76 / 5])


def test_a_large_face_is_averaged_not_skipped():
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (2000, 2000, 3)).astype(np.uint8)
    crop = mouth_crop(image, np.array([[600.0, 600.0], [1320.0, 600.0]]))  # eight times the size
    assert crop.shape == (56, 72, 3)
    assert crop.std() < 20  # of noise with a deviation of 74


def test_outside_of_the_image_its_edge_repeats():
    image = np.full((100, 160, 3), 77, np.uint8)
    assert (mouth_crop(image, np.array([[20.0, 80.0], [110.0, 80.0]])) == 77).all()
