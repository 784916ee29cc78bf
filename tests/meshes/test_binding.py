"""Control points move what is near them on the surface, and nothing else; bindings are stored and painted."""

from __future__ import annotations

import zipfile

import numpy as np
import pytest

from lipmotion.articulation.lip_points import mouth_template
from lipmotion.errors import InputError, ModelFormatError
from lipmotion.meshes.files.binding_files import (
    load_binding,
    read_points,
    read_weights,
    save_binding,
    write_points,
    write_weights,
)
from lipmotion.meshes.fitting.lip_placement import part_named_lips, place_lips_by_points
from lipmotion.meshes.model.binding import MAX_WEIGHTS, bind, paint_weights, skin_vertices
from meshes.heads import SEAM, SIZE, head, lip_points
from oracles.skinning import skinned_vertex_by_vertex


@pytest.fixture(scope="module")
def mesh():
    return head(shapes=False)


@pytest.fixture(scope="module")
def binding(mesh):
    named = lip_points(mesh)
    surface = part_named_lips(mesh, named)
    return bind(mesh, surface, place_lips_by_points(mesh, surface, named))


def _moved(binding, mesh, chosen, way):
    displacements = np.zeros((len(binding.placement.points), 3))
    displacements[chosen] = way
    return (binding.moved(mesh, displacements) - mesh.vertices) / binding.placement.scale


def test_weights_are_a_share_of_1(binding):
    assert binding.weights.min() >= 0
    assert binding.weights.sum(axis=1).max() <= 1 + 1e-9
    assert binding.controls.shape[1] <= MAX_WEIGHTS


def test_the_lower_lip_does_not_drag_the_upper(binding, mesh):
    template = mouth_template()
    moved = _moved(binding, mesh, template.lower | template.jaw, [0, -1, 0])
    middle = np.abs(template.places[:, 0]) < 0.2
    upper = binding.placement.vertices[template.upper & middle]
    lower = binding.placement.vertices[template.lower & middle]
    assert np.abs(moved[upper]).max() < 0.02
    assert moved[lower, 1].max() < -0.9
    chin = binding.placement.vertices[template.row(152)]
    assert moved[chin, 1] < -0.9


def test_the_face_beyond_the_mouth_stands_still(binding, mesh):
    template = mouth_template()
    moved = _moved(binding, mesh, np.ones(len(template.points), bool), [0.3, 0.2, 0.1])
    far = mesh.vertices[:, 1] / SIZE > SEAM + 0.55
    assert np.abs(moved[far]).max() < 1e-9
    held = binding.placement.vertices[~template.jaw]
    np.testing.assert_allclose(moved[held], np.tile([0.3, 0.2, 0.1], (len(held), 1)), atol=1e-6)


def test_teeth_follow_the_jaw(binding, mesh):
    template = mouth_template()
    teeth = next(part for part in mesh.parts if part.name == "teeth")
    rows = np.unique(mesh.triangles[teeth.first : teeth.stop])
    moved = _moved(binding, mesh, template.jaw, [0, -0.5, 0])
    np.testing.assert_allclose(moved[rows], np.tile([0, -0.5, 0], (3, 1)), atol=1e-9)


def test_skinning_is_the_weighted_sum_of_the_transformed_vertices(binding, mesh):
    rng = np.random.default_rng(3)
    matrices = np.tile(np.eye(3, 4), (len(binding.placement.points), 1, 1)) + 0.1 * rng.normal(size=(52, 3, 4))
    rows = binding.rows[:40]
    fast = skin_vertices(binding.matrix[:40], matrices, mesh.vertices[rows])
    slow = skinned_vertex_by_vertex(binding.matrix[:40].toarray(), matrices, mesh.vertices[rows])
    np.testing.assert_allclose(fast, slow, atol=1e-9)
    np.testing.assert_allclose(binding.transformed(mesh, matrices)[rows], slow, atol=1e-9)


def test_a_stored_binding_is_the_same(binding, mesh, tmp_path):
    save_binding(tmp_path / "head.binding", binding, mesh)
    again = load_binding(tmp_path / "head.binding", mesh)
    for name in ("rows", "controls", "weights"):
        np.testing.assert_array_equal(getattr(again, name), getattr(binding, name))
    assert again.placement.vertices.tolist() == binding.placement.vertices.tolist()


def test_a_binding_of_another_mesh_is_refused(binding, mesh, tmp_path):
    save_binding(tmp_path / "head.binding", binding, mesh)
    with pytest.raises(InputError, match="made for"):
        load_binding(tmp_path / "head.binding", head(shapes=False, slit=False))


@pytest.mark.parametrize("damage", ["no zip", "another format", "a weight too large"])
def test_a_damaged_binding_is_refused(binding, mesh, tmp_path, damage):
    path = tmp_path / "head.binding"
    if damage == "a weight too large":
        wrong = type(binding)(binding.placement, binding.rows, binding.controls, np.minimum(3 * binding.weights, 1))
        save_binding(path, wrong, mesh)
    elif damage == "no zip":
        path.write_bytes(b"binding")
    else:
        with zipfile.ZipFile(path, "w") as file:
            file.writestr("header.json", "{}")
    with pytest.raises(ModelFormatError, match="bind the character again"):
        load_binding(path, mesh)


def test_painted_weights_replace_those_of_a_vertex(binding, mesh, tmp_path):
    vertex = int(binding.rows[0])
    (tmp_path / "paint.csv").write_text(
        f"vertex,point,weight\n{vertex},152,0.25\n{vertex},17,0.5\n\n# more\n0,17,2e-1\n"
    )
    after = paint_weights(binding, mesh, read_weights(tmp_path / "paint.csv"))
    template = mouth_template()
    moved = _moved(after, mesh, [template.row(17)], [0, 1, 0])
    assert moved[vertex, 1] == pytest.approx(0.5)
    assert moved[0, 1] == pytest.approx(0.2)
    untouched = binding.rows[1:]
    before = _moved(binding, mesh, [template.row(17)], [0, 1, 0])
    np.testing.assert_allclose(moved[untouched], before[untouched], atol=1e-9)


def test_written_weights_paint_the_same_binding(binding, mesh, tmp_path):
    write_weights(tmp_path / "weights.csv", binding)
    again = paint_weights(binding, mesh, read_weights(tmp_path / "weights.csv"))
    np.testing.assert_allclose(again.matrix.toarray(), binding.matrix.toarray(), atol=1e-5)


def test_written_points_are_read(binding, tmp_path):
    write_points(tmp_path / "points.csv", binding.placement)
    named = read_points(tmp_path / "points.csv")
    assert [named[point] for point in binding.placement.points] == binding.placement.vertices.tolist()


WRONG = [
    ("vertex,weight\n1,2\n", "required vertex,point,weight"),
    ("vertex,point,weight\n1,17\n", "2 columns"),
    ("vertex,point,weight\none,17,1\n", "line 2"),
    ("vertex,point,weight\n1,17,0.5\n1,17,0.5\n", "occur twice"),
    ("vertex,point,weight\n1,17,1.5\n", "is 1.5, required 0 to 1"),
    ("vertex,point,weight\n1,17,nan\n", "is nan, required 0 to 1"),
    ("vertex,point,weight\n-1,17,1\n", "does not exist"),
    ("vertex,point,weight\n1,5,1\n", "is no control point"),
]


def test_paint_is_checked(binding, mesh, tmp_path):
    for text, message in WRONG:
        (tmp_path / "paint.csv").write_text(text)
        with pytest.raises(InputError, match=message):
            paint_weights(binding, mesh, read_weights(tmp_path / "paint.csv"))
