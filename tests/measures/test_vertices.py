import numpy as np
import pytest

from lipmotion.measures.curves import landmark_distance, lip_vertex_error, upper_face_deviation

STILL = np.zeros((4, 3, 3))


def test_the_worst_vertex_of_every_frame_counts_and_the_mean_over_frames() -> None:
    made = STILL.copy()
    made[0, 1] = (3, 0, 4)
    made[0, 2] = (0, 1, 0)
    made[1, 0] = (0, 0, 2)
    assert lip_vertex_error([made], [STILL]) == pytest.approx((5 + 2) / 4)
    assert lip_vertex_error([made, STILL[:2]], [STILL, STILL[:2]]) == pytest.approx((5 + 2) / 6)  # frames, not clips
    assert landmark_distance([made], [STILL]) == pytest.approx((5 + 1 + 2) / 12)


def test_upper_face_deviation_is_how_much_more_the_original_varies_about_its_rest() -> None:
    rest = np.array([[0.0, 1.0, 0.0], [0.0, 2.0, 0.0]])
    original = np.repeat(rest[None], 4, axis=0)
    original[:, 0, 1] += (0, 2, 0, 2)  # deviates by 1 from its mean
    made = np.repeat(rest[None], 4, axis=0)
    made[:, 0, 2] += (0, -1, 0, -1)  # by a half, elsewhere
    assert upper_face_deviation([made], [original], rest) == pytest.approx((1 - 0.5) / 2)
    assert upper_face_deviation([original], [made], rest) == pytest.approx(-(1 - 0.5) / 2)
    raised = made + np.array([0, 0.5, 0])  # a face that is held otherwise does not vary
    assert upper_face_deviation([raised[:, 1:]], [made[:, 1:]], rest[1:]) == pytest.approx(0)
