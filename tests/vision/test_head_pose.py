import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from lipmotion_faces.tracking.head_pose import fit_similarities, remove_head_motion
from lipmotion_faces.tracking.trackers import EYE_CORNERS, JAW_POINTS, LIP_POINTS, NASION, RIGID_POINTS, TRACKED_POINTS

COLUMN = {index: n for n, index in enumerate(TRACKED_POINTS)}
FRAMES = 40


@pytest.fixture
def speech() -> NDArray[np.float64]:
    """A head that keeps still while lips and jaw move [shape=(FRAMES, N, 3)]."""
    rng = np.random.default_rng(5)
    face = rng.uniform(-1, 1, (len(TRACKED_POINTS), 3))
    face[[COLUMN[33], COLUMN[263], COLUMN[10], COLUMN[168]]] = [[-0.5, 0, 0], [0.5, 0, 0], [0, 1, -0.1], [0, 0.1, 0.3]]
    frames = np.repeat(face[None], FRAMES, axis=0)
    spoken = [COLUMN[index] for index in (*LIP_POINTS, *JAW_POINTS)]
    frames[:, spoken] += 0.2 * rng.normal(size=(FRAMES, len(spoken), 3))
    return frames


@pytest.fixture
def moved(speech) -> NDArray[np.float64]:
    rng = np.random.default_rng(6)
    turn = Rotation.from_rotvec(0.4 * rng.normal(size=(FRAMES, 3))).as_matrix()
    size, place = rng.uniform(40, 90, FRAMES), rng.uniform(0, 300, (FRAMES, 3))
    return size[:, None, None] * speech @ turn.transpose(0, 2, 1) + place[:, None, :]


def test_head_motion_is_removed_and_speech_is_not(speech, moved):
    still = remove_head_motion(speech, TRACKED_POINTS)
    np.testing.assert_allclose(remove_head_motion(moved, TRACKED_POINTS), still, atol=1e-6)
    np.testing.assert_allclose(  # distances within a frame, in eye distances, are those of the speech
        np.linalg.norm(still[:, COLUMN[13]] - still[:, COLUMN[14]], axis=1),
        np.linalg.norm(speech[:, COLUMN[13]] - speech[:, COLUMN[14]], axis=1),
        atol=1e-6,
    )


def test_the_axes_are_those_of_the_head(moved):
    head = remove_head_motion(moved, TRACKED_POINTS)
    right, left = (head[:, COLUMN[index]].mean(axis=0) for index in EYE_CORNERS)
    np.testing.assert_allclose(right, [-0.5, 0, 0], atol=1e-6)
    np.testing.assert_allclose(left, [0.5, 0, 0], atol=1e-6)
    forehead, nasion = head[0, COLUMN[10]], head[0, COLUMN[NASION]]
    assert forehead[1] > nasion[1] > 0
    assert nasion[2] > 0
    lean = np.rad2deg(np.arctan2(nasion[2] - forehead[2], forehead[1] - nasion[1]))
    assert lean == pytest.approx(8.6, abs=1e-3)


def test_noise_of_the_rigid_points_hardly_reaches_the_lips(speech, moved):
    clean = remove_head_motion(speech, TRACKED_POINTS)
    noise = np.random.default_rng(7).normal(size=moved.shape)
    noise[:, [COLUMN[index] for index in LIP_POINTS]] = 0
    noisy = remove_head_motion(moved + 0.5 * noise, TRACKED_POINTS)  # under 1 % of the distance between the eyes
    lips = [COLUMN[index] for index in LIP_POINTS]
    assert np.sqrt(np.square(noisy - clean)[:, lips].mean()) < 0.01


def test_similarity_agrees_with_scipy_where_only_rotation_is_asked():
    rng = np.random.default_rng(8)
    target = rng.normal(size=(12, 3))
    points = rng.normal(size=(5, 12, 3))
    turn, scale, shift = fit_similarities(points, target)
    for n in range(5):
        centred = points[n] - points[n].mean(axis=0)
        oracle, _ = Rotation.align_vectors(target - target.mean(axis=0), centred)
        np.testing.assert_allclose(turn[n], oracle.as_matrix(), atol=1e-9)
        moved = scale[n] * points[n] @ turn[n].T + shift[n]
        np.testing.assert_allclose(moved.mean(axis=0), target.mean(axis=0), atol=1e-9)


def test_similarity_is_the_least_squares_solution_and_no_reflection():
    rng = np.random.default_rng(9)
    target, points = rng.normal(size=(12, 3)), rng.normal(size=(1, 12, 3))
    turn, scale, shift = fit_similarities(points, target)

    def cost(turned: NDArray[np.float64], scaled: float, shifted: NDArray[np.float64]) -> float:
        return float(np.square(scaled * points[0] @ turned.T + shifted - target).sum())

    best = cost(turn[0], scale[0], shift[0])
    for _ in range(50):
        other = Rotation.from_rotvec(0.01 * rng.normal(size=3)).as_matrix() @ turn[0]
        assert cost(other, scale[0] * (1 + 0.01 * rng.normal()), shift[0] + 0.01 * rng.normal(size=3)) > best
    mirrored, _, _ = fit_similarities(points * (-1, 1, 1), points[0])
    assert np.linalg.det(mirrored[0]) == pytest.approx(1)
    assert not {*RIGID_POINTS} & {*LIP_POINTS, *JAW_POINTS}
    assert (len({*LIP_POINTS}), len({*JAW_POINTS})) == (40, 12)
