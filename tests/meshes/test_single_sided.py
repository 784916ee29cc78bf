from __future__ import annotations

import numpy as np

from lipmotion.meshes.model.mesh import Mesh, MeshPart
from lipmotion.meshes.model.scene import compute_shading_normals
from lipmotion.meshes.model.surface import drop_back_sides

PLACES = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
FRONT = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
BACK = np.array([[0, 3, 2], [2, 1, 0]], np.int32)


def test_a_part_with_both_sides_is_held_once():
    uv = np.arange(6 * 3 * 2.0).reshape(6, 3, 2)
    parts = (MeshPart("one", 0, 2), MeshPart("leaf", 2, 6))
    places = np.concatenate([PLACES, PLACES + 5])
    mesh = drop_back_sides(Mesh(places, np.concatenate([FRONT, FRONT + 4, BACK + 4]), parts, uv=uv))
    assert mesh.triangles.tolist() == [*FRONT.tolist(), *(FRONT + 4).tolist()]
    assert [(part.first, part.stop, part.material.two_sided) for part in mesh.parts] == [(0, 2, False), (2, 4, True)]
    np.testing.assert_allclose(mesh.uv, uv[:4])


def test_other_meshes_stay_as_they_are():
    for triangles in (FRONT, np.concatenate([FRONT, FRONT]), np.concatenate([FRONT, BACK[:1]])):
        mesh = Mesh(PLACES, triangles)
        assert drop_back_sides(mesh) is mesh


def test_both_sides_in_two_parts_stay():
    mesh = Mesh(PLACES, np.concatenate([FRONT, BACK]), (MeshPart("front", 0, 2), MeshPart("back", 2, 4)))
    assert drop_back_sides(mesh) is mesh


def test_normals_of_both_sides_do_not_cancel_out():
    normals = compute_shading_normals(Mesh(PLACES, np.concatenate([FRONT, BACK])))
    np.testing.assert_allclose(normals.rest, np.tile([0.0, 0, 1], (4, 1)))
