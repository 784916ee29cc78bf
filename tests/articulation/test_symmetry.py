from __future__ import annotations

from dataclasses import replace

import pytest

from lipmotion.articulation.symmetry import make_symmetrical
from meshes.speech import motion


def test_both_sides_move_alike_by_as_much_as_is_asked_for():
    moved = motion()
    values = moved.values.copy()
    values[:, moved.column("y_61")] += 0.02
    lopsided = replace(moved, values=values)
    for asymmetry, left in ((0.0, 0.0), (0.5, 0.01), (1.0, 0.02)):
        alike = make_symmetrical(lopsided, asymmetry)
        assert alike["y_61"] - alike["y_291"] == pytest.approx(left, abs=1e-9)
        assert alike["x_61"] + alike["x_291"] == pytest.approx(0.0, abs=1e-9)
        assert alike["opening"] == pytest.approx(moved["opening"])
    assert make_symmetrical(make_symmetrical(lopsided), 0.0)["y_61"] == pytest.approx(
        make_symmetrical(lopsided)["y_61"]
    )


def test_motion_without_points_stays_as_it_is():
    distances = motion(points=False)
    assert make_symmetrical(distances) is distances
