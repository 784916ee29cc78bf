"""Meshes check themselves; blendshapes add up."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.meshes.model.mesh import Blendshape, Mesh, MeshPart

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
SQUARE = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def _mesh(**changes) -> Mesh:
    up = Blendshape("up", np.array([2, 3]), np.array([[0.0, 1, 0], [0, 2, 0]]))
    out = Blendshape("out", np.array([3]), np.array([[0.0, 0, 4]]))
    return Mesh(**({"vertices": CORNERS, "triangles": SQUARE, "shapes": (up, out)} | changes))


def test_displacements_of_some_vertices():
    moved = _mesh().displacements(np.array([3, 0]))
    np.testing.assert_allclose(moved, [[[0, 2, 0], [0, 0, 0]], [[0, 0, 4], [0, 0, 0]]], atol=1e-12)


def test_a_blendshape_keeps_only_what_moves():
    shape = CORNERS.copy()
    shape[1] += [0, 0, 1e-9]
    shape[2] += [0, 0, 0.5]
    assert Blendshape.between("a", CORNERS, shape, least=1e-6).rows.tolist() == [2]


WRONG = [
    ({"vertices": CORNERS[:, :2]}, "shape"),
    ({"vertices": np.full((4, 3), np.nan)}, "finite"),
    ({"triangles": SQUARE + 1}, "1 to 4, required 0 to 3"),
    ({"triangles": SQUARE[:, :2]}, "required"),
    ({"triangles": SQUARE - 1}, "-1 to 2"),
    ({"triangles": SQUARE.astype(float)}, "whole numbers"),
    ({"uv": np.zeros((2, 2))}, "uv"),
    ({"parts": (MeshPart("a", 0, 1),)}, "parts"),
    ({"parts": (MeshPart("a", 0, 1), MeshPart("b", 0, 2))}, "parts"),
    ({"shapes": (Blendshape("a", np.array([9]), np.zeros((1, 3))),)}, "'a'"),
    ({"shapes": (Blendshape("a", np.array([1, 2]), np.zeros((1, 3))),)}, "as many"),
    ({"shapes": (Blendshape("a", np.array([1]), np.zeros((1, 3))),) * 2}, "one name"),
]


def test_what_does_not_fit_is_refused():
    for changes, message in WRONG:
        with pytest.raises(InputError, match=message):
            _mesh(**changes)
