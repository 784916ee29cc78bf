"""Lip points are found by what opens the mouth, or from four that are named."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion.articulation.lip_points import mouth_template
from lipmotion.errors import InputError
from lipmotion.meshes.fitting import lip_placement
from lipmotion.meshes.fitting.lip_placement import part_named_lips, place_lips_by_points, place_lips_by_shape
from lipmotion.meshes.model.mesh import Blendshape, Mesh
from lipmotion.meshes.model.surface import build_surface
from meshes.heads import COLUMNS, HALF, SEAM, SIZE, head, lip_points, shaped

GRID = 0.05 * SIZE
"""The distance between vertices."""


def _named(mesh):
    named = lip_points(mesh)
    return place_lips_by_points(mesh, part_named_lips(mesh, named), named)


def _offsets(mesh, placement):
    """How far each lip point is from where the template would have it."""
    template = mouth_template()
    centre = np.array([0, SEAM, 0]) * SIZE
    lips = ~template.jaw & ~template.corner
    wanted = centre[:2] + SIZE * HALF * 2 / template.width * (template.places - template.centre)[lips, :2]
    return np.abs(mesh.vertices[placement.vertices[lips], :2] - wanted).max()


@pytest.mark.parametrize("named", [False, True])
def test_points_are_where_the_mouth_is(named):
    mesh = head(shapes=not named)
    surface = build_surface(mesh)
    placement = _named(mesh) if named else place_lips_by_shape(mesh, surface)
    assert _offsets(mesh, placement) < 1.5 * GRID
    assert placement.scale == pytest.approx(SIZE * 2 * HALF / mouth_template().width, rel=0.25)


@pytest.mark.parametrize("named", [False, True])
def test_upper_points_are_on_the_upper_lip(named):
    mesh = head()
    surface = build_surface(mesh)
    placement = _named(mesh) if named else place_lips_by_shape(mesh, surface)
    drop = (shaped(mesh, {"jawOpen": 1.0}) - mesh.vertices)[placement.vertices, 1]
    template = mouth_template()
    middle = np.abs(template.places[:, 0]) < 0.2
    assert np.abs(drop[template.upper]).max() < 1e-9
    assert drop[template.lower & middle].max() < -0.1 * SIZE


def test_a_turned_head_is_found_by_its_eye_corners():
    mesh = head()
    turn = np.array([[0.0, 0, -1], [1, 0, 0], [0, -1, 0]]).T
    named = lip_points(mesh)
    for point, x in ((33, -0.5), (263, 0.5)):
        named[point] = int(np.abs(mesh.vertices[:, :2] / SIZE - [x, 0.0]).sum(axis=1).argmin())
    turned = Mesh(mesh.vertices @ turn.T, mesh.triangles)
    placement = place_lips_by_points(turned, part_named_lips(turned, named), named)
    upright = place_lips_by_points(mesh, part_named_lips(mesh, named), named)
    assert placement.vertices.tolist() == upright.vertices.tolist()
    np.testing.assert_allclose(placement.axes, turn @ upright.axes, atol=1e-9)
    moved = placement.to_mesh(np.array([[0.0, -1, 0]]))
    np.testing.assert_allclose(placement.to_motion(moved), [[0.0, -1, 0]], atol=1e-12)


def test_a_mouth_that_is_not_cut_open_is_refused():
    mesh = head(shapes=False, slit=False)
    named = lip_points(head(shapes=False))
    named[14] = named[13] + len(COLUMNS)
    with pytest.raises(InputError, match="hang together"):
        place_lips_by_points(mesh, build_surface(mesh), named)


def test_named_points_are_checked():
    mesh = head(shapes=False)
    for named, message in (
        ({61: 0, 291: 1, 13: 2}, "14 are missing"),
        ({61: 0, 291: 1, 13: 2, 14: 99999}, "vertex 99999, required 0 to"),
        ({61: 0, 291: 1, 13: 2, 14: 2}, "are one vertex"),
        ({61: 0, 291: 1, 13: 2, 14: 3, 5: 4}, "5 is no lip or jaw point"),
    ):
        with pytest.raises(InputError, match=message):
            place_lips_by_points(mesh, build_surface(mesh), named)


def test_a_mesh_without_a_shape_that_opens_says_what_it_has():
    mesh = head()
    closed = Mesh(mesh.vertices, mesh.triangles, shapes=tuple(s for s in mesh.shapes if s.name == "mouthPucker"))
    with pytest.raises(InputError, match="the mesh has: mouthPucker"):
        place_lips_by_shape(closed, build_surface(closed))


def test_a_shape_that_parts_no_lips_is_refused():
    mesh = head(shapes=False, slit=False)
    whole = Blendshape.between("jawOpen", mesh.vertices, mesh.vertices - [0, SIZE, 0])
    with pytest.raises(InputError, match="parts no lips"):
        place_lips_by_shape(Mesh(mesh.vertices, mesh.triangles, shapes=(whole,)), build_surface(mesh))


def test_of_a_dense_mesh_some_vertices_are_compared(monkeypatch):
    mesh = head()
    surface = build_surface(mesh)
    whole = place_lips_by_shape(mesh, surface)
    monkeypatch.setattr(lip_placement, "MAX_PAIRS", 1500)
    thinned = place_lips_by_shape(mesh, surface)
    assert (thinned.vertices != whole.vertices).any()
    assert _offsets(mesh, thinned) < 2 * GRID
    assert thinned.scale == pytest.approx(whole.scale, rel=0.2)
