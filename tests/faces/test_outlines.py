import numpy as np
import pytest

from lipmotion_faces.portrait.design import STEPS, closed_curve, mirror_curve, open_curve, path_points, stroke

PATH = "0 0, 1 0.5, 2 -0.5, 3 0"


def test_curves_go_through_their_points():
    assert open_curve(PATH)[::STEPS] == pytest.approx(path_points(PATH))
    assert closed_curve(PATH)[::STEPS] == pytest.approx(path_points(PATH))


def test_curves_are_smooth():
    steps = np.diff(closed_curve("0 0, 1 0, 1 1, 0 1"), axis=0)
    turns = np.abs(np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))))
    assert turns.max() < 0.3


def test_a_straight_path_stays_straight():
    line = open_curve([(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)])
    assert line[:, 0] == pytest.approx(line[:, 1])


def test_symmetric_outlines_mirror_themselves():
    outline = mirror_curve("0 -1, 1 0, 0.5 0.5, 0 1")
    mirrored = outline * (-1, 1)
    away = np.abs(outline[:, None] - mirrored[None]).sum(axis=2).min(axis=1)
    assert away.max() < 1e-9


def test_a_stroke_is_as_wide_as_asked():
    outline = stroke(open_curve("0 0, 1 0, 2 0"), [0.2, 0.4])
    assert outline[0, 1] - outline[-1, 1] == pytest.approx(0.2)
    assert np.ptp(outline[:, 1]) == pytest.approx(0.4)
