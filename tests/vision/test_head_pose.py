import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from lipmotion_faces.tracking import head_pose, image_similarity, trackers

COLUMN = {index: n for n, index in enumerate(trackers.TRACKED_POINTS)}
FRAMES = 40


@pytest.fixture
def speech() -> NDArray[np.float64]:
    """A head that keeps still while lips and jaw move [shape=(FRAMES, N, 3)]."""
    rng = np.random.default_rng(5)
    face = rng.uniform(-1, 1, (len(trackers.TRACKED_POINTS), 3))
    face[[COLUMN[33], COLUMN[263], COLUMN[10], COLUMN[168]]] = [[-0.5, 0, 0], [0.5, 0, 0], [0, 1, -0.1], [0, 0.1, 0.3]]
    frames = np.repeat(face[None], FRAMES, axis=0)
    spoken = [COLUMN[index] for index in (*trackers.LIP_POINTS, *trackers.JAW_POINTS)]
    frames[:, spoken] += 0.2 * rng.normal(size=(FRAMES, len(spoken), 3))
    return frames


@pytest.fixture
def moved(speech) -> NDArray[np.float64]:
    rng = np.random.default_rng(6)
    turn = Rotation.from_rotvec(0.4 * rng.normal(size=(FRAMES, 3))).as_matrix()
    size, place = rng.uniform(40, 90, FRAMES), rng.uniform(0, 300, (FRAMES, 3))
    return size[:, None, None] * speech @ turn.transpose(0, 2, 1) + place[:, None, :]


def test_head_motion_is_removed_and_speech_is_not(speech, moved):
    still = head_pose.remove_head_motion(speech)
    np.testing.assert_allclose(head_pose.remove_head_motion(moved), still, atol=1e-6)
    np.testing.assert_allclose(  # distances within a frame, in eye distances, are those of the speech
        np.linalg.norm(still[:, COLUMN[13]] - still[:, COLUMN[14]], axis=1),
        np.linalg.norm(speech[:, COLUMN[13]] - speech[:, COLUMN[14]], axis=1),
        atol=1e-6,
    )


def test_the_axes_are_those_of_the_head(moved):
    head = head_pose.remove_head_motion(moved)
    right, left = (head[:, COLUMN[index]].mean(axis=0) for index in trackers.EYE_CORNERS)
    np.testing.assert_allclose(right, [-0.5, 0, 0], atol=1e-6)
    np.testing.assert_allclose(left, [0.5, 0, 0], atol=1e-6)
    forehead, nasion = head[0, COLUMN[10]], head[0, COLUMN[trackers.NASION]]
    assert forehead[1] > nasion[1] > 0
    assert nasion[2] > 0
    lean = np.rad2deg(np.arctan2(nasion[2] - forehead[2], forehead[1] - nasion[1]))
    assert lean == pytest.approx(8.6, abs=1e-3)


def test_similarity_is_the_least_squares_solution_and_no_reflection():
    rng = np.random.default_rng(9)
    target, points = rng.normal(size=(12, 3)), rng.normal(size=(1, 12, 3))
    turn, scale, shift = head_pose.fit_similarities(points, target)

    def cost(turned: NDArray[np.float64], scaled: float, shifted: NDArray[np.float64]) -> float:
        return float(np.square(scaled * points[0] @ turned.T + shifted - target).sum())

    best = cost(turn[0], scale[0], shift[0])
    for _ in range(50):
        other = Rotation.from_rotvec(0.01 * rng.normal(size=3)).as_matrix() @ turn[0]
        assert cost(other, scale[0] * (1 + 0.01 * rng.normal()), shift[0] + 0.01 * rng.normal(size=3)) > best
    mirrored, _, _ = head_pose.fit_similarities(points * (-1, 1, 1), points[0])
    assert np.linalg.det(mirrored[0]) == pytest.approx(1)
    assert not {*trackers.RIGID_POINTS} & {*trackers.LIP_POINTS, *trackers.JAW_POINTS}
    assert (len({*trackers.LIP_POINTS}), len({*trackers.JAW_POINTS})) == (40, 12)


cv2 = pytest.importorskip("cv2")


def ramp(width: int, height: int) -> np.ndarray:
    """Red rises to the right and green downwards, one a pixel centre."""
    image = np.zeros((height, width, 3), np.uint8)
    image[..., 0] = np.arange(width)
    image[..., 1] = np.arange(height)[:, None]
    return image


def nodding(frames: int = 12) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A head that nods, turns and comes nearer while it speaks: points in its own frame, then where it is."""
    column = {index: n for n, index in enumerate(trackers.TRACKED_POINTS)}
    draw = np.random.default_rng(4)
    face = draw.uniform(-0.8, 0.8, (len(trackers.TRACKED_POINTS), 3))
    slope = np.deg2rad(trackers.FOREHEAD_SLOPE_DEG)
    face[[column[33], column[263], column[10], column[168]]] = [
        [-0.5, 0, 0],
        [0.5, 0, 0],
        [0, 0.1 + np.cos(slope), 0.3 - np.sin(slope)],
        [0, 0.1, 0.3],
    ]
    head = np.repeat(face[None], frames, axis=0)
    head[:, [column[index] for index in trackers.LIP_POINTS], :2] += 0.1 * draw.normal(
        size=(frames, len(trackers.LIP_POINTS), 2)
    )
    turns = Rotation.from_rotvec(0.3 * draw.normal(size=(frames, 3))).as_matrix()
    return head, turns, draw.uniform(50, 200, frames), draw.uniform(100, 300, (frames, 3))


def test_the_lips_are_found_whatever_the_head_does():
    head, turns, sizes, places = nodding()
    points = (sizes[:, None, None] * head @ turns.transpose(0, 2, 1) + places[:, None]) * (1, -1, -1)
    depth = head[:, [trackers.TRACKED_POINTS.index(index) for index in trackers.LIP_POINTS], 2].mean()
    maps = head_pose.map_face(points)
    for turn, size, place, to_image in zip(turns, sizes, places, maps, strict=True):
        for x, y in ((0, 0), (-36, 48), (36, 104), (12, 70)):  # px of the region, y down
            seen = size * turn @ np.array([x / 90, -y / 90, depth]) + place
            np.testing.assert_allclose(to_image @ [x, y, 1], [seen[0], -seen[1]], atol=1e-6)


DRAW = np.random.default_rng(5)
COARSE = DRAW.uniform(40, 215, (9, 12, 3))


def picture(scale: int) -> np.ndarray:
    """Squares of many colours, on a grid of 12 by 9."""
    return np.kron(COARSE, np.ones((scale, scale, 1))).astype(np.uint8)


def test_a_face_looks_the_same_from_nearer_and_turned():
    far, near = picture(10), picture(30)
    eyes = np.array([[40.0, 40.0], [80.0, 40.0]])
    upright = image_similarity.reduce_face(far, eyes)
    assert image_similarity.correlate_images(upright, image_similarity.reduce_face(near, 3 * eyes)) > 0.95
    turned = image_similarity.reduce_face(np.rot90(far), np.stack([eyes[:, 1], far.shape[1] - eyes[:, 0]], axis=1))
    assert image_similarity.correlate_images(upright, turned) > 0.95
    shifted = image_similarity.reduce_face(far, eyes + np.array([20, 25]))
    assert image_similarity.correlate_images(upright, shifted) < 0.6


def test_likeness_is_a_correlation_without_tint():
    one, other = DRAW.uniform(0, 255, (2, 6, 5, 3))
    assert image_similarity.correlate_images(one, 0.5 * one + (10, 20, 30)) == pytest.approx(1)
    assert image_similarity.correlate_images(one, 200 - one) == pytest.approx(-1)
    assert image_similarity.correlate_images(one, np.full_like(one, 90)) == 0
    assert image_similarity.correlate_images(np.stack([one, other])[:, None], np.stack([one, other])).shape == (2, 2)


def mouths(count: int = 40) -> np.ndarray:
    usual = np.kron(DRAW.uniform(60, 190, (7, 9, 3)), np.ones((8, 8, 1)))
    frames = usual + DRAW.normal(0, 8, (count, *usual.shape))
    return np.stack([image_similarity.reduce_mouth(frame.clip(0, 255).astype(np.uint8)) for frame in frames])


def test_boxes_and_other_textures_are_strange_at_any_shift():
    for value in (0, 255, None):
        frames = mouths()
        frames[10:18] = DRAW.integers(0, 255, frames[10:18].shape) if value is None else value
        assert np.flatnonzero(image_similarity.find_occluded_mouths(frames)).tolist() == list(range(10, 18))


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
