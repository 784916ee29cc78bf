import numpy as np
import pytest

from lipmotion.articulation.lip_points import LEFT_CORNER, RIGHT_CORNER, mouth_template
from lipmotion.rig.reference_mouth import arkit_mouth
from lipmotion.rig.rounding import rounded_displacements, rounded_weights, roundness
from lipmotion.rig.shape_weights import shape_weights
from rig.speech import motion, units

TIME_S = np.arange(201) / 100


def test_lips_are_round_in_oo_alone():
    curve = roundness(units(), TIME_S)
    assert curve[115] > 0.95  # uw
    assert curve[75] < 0.01  # aa
    assert curve[10] < 0.01  # silence
    assert np.abs(np.diff(curve)).max() < 0.2


def test_the_weights_are_never_less_round_than_before():
    shapes = arkit_mouth()
    weights = np.full((3, len(shapes.names)), 0.3)
    result = rounded_weights(weights, shapes, np.array([0.0, 0.5, 1.0]))
    pucker, smile = shapes.row("mouthPucker"), shapes.row("mouthSmileLeft")
    assert result[:2, pucker] == pytest.approx([0.3, 0.3])
    assert 0.4 < result[2, pucker] <= 0.7
    assert result[:, smile] == pytest.approx([0.3, 0.15, 0.0])


def test_the_solved_weights_pucker_in_oo():
    weights = shape_weights(motion(), units(), arkit_mouth())
    assert weights["mouthPucker"][115] > 0.38
    assert weights["mouthPucker"][75] < 0.3


def test_points_of_round_lips_come_together_and_forward():
    template = mouth_template()
    moved = rounded_displacements(np.zeros((2, len(template.points), 3)), np.array([0.0, 1.0]))
    assert not moved[0].any()
    right, left = moved[1, template.row(RIGHT_CORNER)], moved[1, template.row(LEFT_CORNER)]
    assert right[0] > 0.03
    assert left[0] < -0.03
    assert min(right[2], left[2]) > 0.05
    assert not moved[1, template.jaw].any()
