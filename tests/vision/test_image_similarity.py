import numpy as np
import pytest

from lipmotion_faces.tracking import image_similarity

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
    assert image_similarity.scene_thumbnail(image).shape == (24, 32, 3)
    np.testing.assert_allclose(
        image_similarity.scene_thumbnail(image), image_similarity.scene_thumbnail(image + np.uint8(30)), atol=1
    )
    assert abs(image_similarity.scene_thumbnail(image).mean()) < 1e-9


def test_a_face_looks_the_same_from_nearer_and_turned():
    far, near = picture(10), picture(30)
    eyes = np.array([[40.0, 40.0], [80.0, 40.0]])
    upright = image_similarity.face_thumbnail(far, eyes)
    assert image_similarity.image_correlation(upright, image_similarity.face_thumbnail(near, 3 * eyes)) > 0.95
    turned = image_similarity.face_thumbnail(np.rot90(far), np.stack([eyes[:, 1], far.shape[1] - eyes[:, 0]], axis=1))
    assert image_similarity.image_correlation(upright, turned) > 0.95
    assert (
        image_similarity.image_correlation(upright, image_similarity.face_thumbnail(far, eyes + np.array([20, 25])))
        < 0.6
    )


def test_likeness_is_a_correlation_without_tint():
    one, other = DRAW.uniform(0, 255, (2, 6, 5, 3))
    assert image_similarity.image_correlation(one, 0.5 * one + (10, 20, 30)) == pytest.approx(1)
    assert image_similarity.image_correlation(one, 200 - one) == pytest.approx(-1)
    assert image_similarity.image_correlation(one, np.full_like(one, 90)) == 0
    assert image_similarity.image_correlation(np.stack([one, other])[:, None], np.stack([one, other])).shape == (2, 2)


def mouths(count: int = 40) -> np.ndarray:
    usual = np.kron(DRAW.uniform(60, 190, (7, 9, 3)), np.ones((8, 8, 1)))
    frames = usual + DRAW.normal(0, 8, (count, *usual.shape))
    return np.stack([image_similarity.mouth_thumbnail(frame.clip(0, 255).astype(np.uint8)) for frame in frames])


def test_boxes_and_other_textures_are_strange_at_any_shift():
    for value in (0, 255, None):
        frames = mouths()
        frames[10:18] = DRAW.integers(0, 255, frames[10:18].shape) if value is None else value
        assert np.flatnonzero(image_similarity.find_occluded_mouths(frames)).tolist() == list(range(10, 18))


def test_where_the_usual_look_is_flat_nothing_is_strange():
    frames = np.full((20, 14, 18, 3), 100, np.uint8)
    frames[3] = 250
    assert not image_similarity.find_occluded_mouths(frames).any()


def test_neither_usual_mouths_nor_other_light_nor_a_nod_are_strange():
    usual = mouths()
    assert not image_similarity.find_occluded_mouths(usual).any()
    dark = usual.copy()
    dark[10:18] //= 2
    assert not image_similarity.find_occluded_mouths(dark).any()
    for rows in (-4, -2, 3):
        nodded = usual.copy()
        nodded[10:18] = np.roll(nodded[10:18], rows, axis=1)
        assert not image_similarity.find_occluded_mouths(nodded).any()
