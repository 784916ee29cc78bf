import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lipmotion_faces.tracking.head_pose import crop_mouth, eyes_to_image, face_to_image, region_to_image
from lipmotion_faces.tracking.trackers import FOREHEAD_SLOPE_DEG, LIP_POINTS, TRACKED_POINTS

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
    np.testing.assert_array_equal(crop_mouth(image, eyes_to_image(eyes)), image[98 : 98 + 56, 69 : 69 + 72])


def test_the_eyes_of_the_turned_head_become_level():
    angle = np.deg2rad(20)
    half = 45 * np.array([np.cos(angle), np.sin(angle)])
    crop = crop_mouth(ramp(256, 200), eyes_to_image(np.array([130, 80]) + np.stack([-half, half])))
    along = np.diff(crop[28].astype(int), axis=0).mean(axis=0)
    np.testing.assert_allclose(along[:2], [np.cos(angle), np.sin(angle)], atol=0.03)


def test_region_pixels_map_to_the_head():
    eyes = np.array([[10.0, 20.0], [28.0, 20.0]])  # 18 px: five region pixels to one of the image
    matrix = region_to_image(eyes_to_image(eyes))
    # the centre of the region, (36, 28) from its corner, lies (0, 76) from between the eyes
    centre = matrix @ [35.5, 27.5, 1]
    np.testing.assert_allclose(centre + 0.5, [19, 20 + 76 / 5])


def test_a_large_face_is_averaged_not_skipped_and_outside_of_the_image_its_edge_repeats():
    image = np.random.default_rng(0).integers(0, 256, (2000, 2000, 3)).astype(np.uint8)
    crop = crop_mouth(image, eyes_to_image(np.array([[600.0, 600.0], [1320.0, 600.0]])))  # eight times the size
    assert crop.shape == (56, 72, 3)
    assert crop.std() < 20  # of noise with a deviation of 74
    flat = np.full((100, 160, 3), 77, np.uint8)
    assert (crop_mouth(flat, eyes_to_image(np.array([[20.0, 80.0], [110.0, 80.0]]))) == 77).all()


def nodding(frames: int = 12) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A head that nods, turns and comes nearer while it speaks: points in its own frame, then where it is."""
    column = {index: n for n, index in enumerate(TRACKED_POINTS)}
    draw = np.random.default_rng(4)
    face = draw.uniform(-0.8, 0.8, (len(TRACKED_POINTS), 3))
    slope = np.deg2rad(FOREHEAD_SLOPE_DEG)
    face[[column[33], column[263], column[10], column[168]]] = [
        [-0.5, 0, 0],
        [0.5, 0, 0],
        [0, 0.1 + np.cos(slope), 0.3 - np.sin(slope)],
        [0, 0.1, 0.3],
    ]
    head = np.repeat(face[None], frames, axis=0)
    head[:, [column[index] for index in LIP_POINTS], :2] += 0.1 * draw.normal(size=(frames, len(LIP_POINTS), 2))
    turns = Rotation.from_rotvec(0.3 * draw.normal(size=(frames, 3))).as_matrix()
    return head, turns, draw.uniform(50, 200, frames), draw.uniform(100, 300, (frames, 3))


def test_the_lips_are_found_whatever_the_head_does():
    head, turns, sizes, places = nodding()
    points = (sizes[:, None, None] * head @ turns.transpose(0, 2, 1) + places[:, None]) * (1, -1, -1)
    depth = head[:, [TRACKED_POINTS.index(index) for index in LIP_POINTS], 2].mean()
    maps = face_to_image(points)
    for turn, size, place, to_image in zip(turns, sizes, places, maps, strict=True):
        for x, y in ((0, 0), (-36, 48), (36, 104), (12, 70)):  # px of the region, y down
            seen = size * turn @ np.array([x / 90, -y / 90, depth]) + place
            np.testing.assert_allclose(to_image @ [x, y, 1], [seen[0], -seen[1]], atol=1e-6)


def test_a_face_straight_ahead_is_cut_out_as_by_its_eyes():
    head, *_ = nodding()
    points = (head * 75 + (120, -90, 0)) * (1, -1, -1)
    eyes = points[0][[TRACKED_POINTS.index(33), TRACKED_POINTS.index(263)], :2]
    np.testing.assert_allclose(face_to_image(points)[0], eyes_to_image(eyes), atol=1e-9)
    image = np.random.default_rng(1).integers(0, 256, (220, 260, 3)).astype(np.uint8)
    crops = [crop_mouth(image, to_image) for to_image in (face_to_image(points)[0], eyes_to_image(eyes))]
    assert np.abs(np.subtract(*crops, dtype=int)).max() <= 1
