import numpy as np
import pytest

from lipmotion.articulation.lip_points import LEFT_CORNER, RIGHT_CORNER, mouth_template
from lipmotion.meshes.fitting.blendshape_motion import arkit_mouth
from lipmotion.meshes.fitting.point_motion import move_points
from lipmotion.meshes.fitting.shape_weights import round_lips, solve_shape_weights
from meshes.speech import motion, units

TIME_S = np.arange(201) / 100


def test_the_weights_are_never_less_round_than_before():
    shapes = arkit_mouth()
    weights = np.full((3, len(shapes.names)), 0.3)
    result = round_lips(weights, shapes, np.array([0.0, 0.5, 1.0]))
    pucker, smile = shapes.row("mouthPucker"), shapes.row("mouthSmileLeft")
    assert result[:2, pucker] == pytest.approx([0.3, 0.3])
    assert 0.3 <= result[2, pucker] <= 0.5
    assert result[:, smile] == pytest.approx([0.3, 0.15, 0.0])


def test_the_solved_weights_pucker_in_oo():
    weights = solve_shape_weights(motion(), units(), arkit_mouth())
    assert weights["mouthPucker"][115] > 0.38
    assert weights["mouthPucker"][75] < 0.3


def test_points_of_round_lips_come_together_and_forward():
    template = mouth_template()
    moved = move_points(motion(points=False), units()).displacements
    right, left = moved[115, template.row(RIGHT_CORNER)], moved[115, template.row(LEFT_CORNER)]  # uw
    assert right[0] > 0.03
    assert left[0] < -0.03
    assert min(right[2], left[2]) > 0.02
    assert np.abs(moved[20]).max() < 1e-6  # silence
