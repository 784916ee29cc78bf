"""Colours of vertices, from files to pictures."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.meshes.files.character_files import read_obj, read_obj_folder
from lipmotion.meshes.files.gltf_scene import read_gltf
from lipmotion.meshes.model.mesh import BLEND, MASK, OPAQUE
from lipmotion.meshes.model.textures import decode_srgb
from lipmotion_faces.head.stage import figure, head_mesh
from meshes.gltf import document, glb, textured_document, with_colours
from meshes.heads import write_glb
from meshes.test_textures import encoded, picture_of

LIGHT = np.array([[1.0, 0.0, 0.5], [0.2, 1.0, 0.0], [0.0, 0.25, 1.0], [0.75, 0.5, 0.0]])
CLEAR = np.concatenate([np.tile([1.0, 0.5, 0.25], (4, 1)), np.array([[0.6], [0.0], [0.6], [1.0]])], axis=1)
"""The mean opacity of the lower right triangle is 0.4, that of the upper left one 0.73."""
SQUARE = "f 1 2 3\nf 1 3 4\n"
FULL = {"<f4": 1, "u1": 255, "<u2": 65535}


def _read(tmp_path, content, binary):
    (tmp_path / "head.glb").write_bytes(glb(content, binary))
    return read_gltf(tmp_path / "head.glb")


def _coloured(tmp_path, colours, material=None, *, normalised=False):
    content, binary = with_colours(*document(), colours, normalised=normalised)
    if material is not None:
        content["materials"] = [material]
        content["meshes"][0]["primitives"][0]["material"] = 0
    return _read(tmp_path, content, binary)


@pytest.mark.parametrize("width", [3, 4])
@pytest.mark.parametrize(("kind", "normalised"), [("<f4", False), ("u1", True), ("<u2", True), ("u1", False)])
def test_colours_of_every_kind_are_read_as_light(tmp_path, kind, normalised, width):
    given = np.concatenate([LIGHT, np.ones((4, 1))], axis=1)[:, :width] * FULL[kind]
    stored = (given if kind == "<f4" else np.rint(given)).astype(kind)
    mesh = _coloured(tmp_path, stored, normalised=normalised)
    np.testing.assert_allclose(decode_srgb(mesh.colours), LIGHT, atol=0.003)


def test_colours_are_multiplied_by_that_of_the_material(tmp_path):
    factor = [0.5, 1.0, 0.25, 1.0]
    mesh = _coloured(tmp_path, LIGHT.astype("<f4"), {"pbrMetallicRoughness": {"baseColorFactor": factor}})
    np.testing.assert_allclose(decode_srgb(mesh.colours), LIGHT * factor[:3], atol=1e-6)


def test_colours_beyond_white_are_white(tmp_path):
    mesh = _coloured(tmp_path, (LIGHT * 4).astype("<f4"))
    np.testing.assert_allclose(decode_srgb(mesh.colours), np.minimum(LIGHT * 4, 1), atol=1e-6)


def test_a_texture_is_multiplied_by_colours(tmp_path):
    white = encoded(np.full((2, 2, 4), 255, np.uint8))
    plain = picture_of(_read(tmp_path, *textured_document(white)))[32, 32]
    red = np.tile([1.0, 0.2, 0.0], (4, 1)).astype("<f4")
    tinted = picture_of(_read(tmp_path, *with_colours(*textured_document(white), red)))[32, 32]
    assert tinted[0] == plain[0]
    assert 0 < tinted[1] < plain[1]
    assert tinted[2] == 0


@pytest.mark.parametrize("mode", [OPAQUE, MASK, BLEND])
@pytest.mark.parametrize("textured", [False, True])
def test_their_opacity_counts_as_the_material_says(tmp_path, mode, textured):
    material = {"alphaMode": mode}
    if textured:
        white = encoded(np.full((2, 2, 4), 255, np.uint8))
        mesh = _read(tmp_path, *with_colours(*textured_document(white, material), CLEAR.astype("<f4")))
    else:
        mesh = _coloured(tmp_path, CLEAR.astype("<f4"), material)
    picture = picture_of(mesh).astype(int)
    lower, upper, whole = picture[38, 46, 0], picture[26, 18, 0], 0.8 * 255
    if mode == OPAQUE:
        assert min(lower, upper) > whole
    elif mode == MASK:
        assert lower == 0
        assert upper > whole
    else:
        assert 0 < lower < upper < lower + 100


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda accessor: accessor.update(componentType=5122), "required VEC3 or VEC4"),
        (lambda accessor: accessor.update(type="VEC2"), "required VEC3 or VEC4"),
        (lambda accessor: accessor.update(count=3), "an array of 3 elements, required 4"),
    ],
)
def test_colours_that_do_not_fit_are_refused(tmp_path, change, message):
    content, binary = with_colours(*document(), LIGHT.astype("<f4"))
    change(content["accessors"][-1])
    with pytest.raises(InputError, match=message):
        _read(tmp_path, content, binary)


@pytest.mark.long
def test_colours_of_the_head_come_back_from_its_own_file(tmp_path):
    head = head_mesh(figure())
    write_glb(tmp_path / "head.glb", head)
    back = read_gltf(tmp_path / "head.glb")
    assert len(back.triangles) == len(head.triangles)
    for part in head.parts:
        same = next(each for each in back.parts if each.material.name == part.name)
        before = head.colours[head.triangles[part.first : part.stop]]
        np.testing.assert_allclose(back.colours[back.triangles[same.first : same.stop]], before, atol=1e-5)


def test_colours_of_obj_vertices(tmp_path):
    rows = ["v 0 0 0 1 0 0.5", "v 1 0 0 0 1 0", "v 1 1 0", "v 0 1 0 0 0 1"]
    (tmp_path / "neutral.obj").write_text("\n".join(rows) + "\n" + SQUARE)
    mesh = read_obj(tmp_path / "neutral.obj")
    np.testing.assert_allclose(mesh.colours, [[1, 0, 0.5], [0, 1, 0], mesh.parts[0].material.colour, [0, 0, 1]])
    np.testing.assert_allclose(read_obj_folder(tmp_path).colours, mesh.colours)


def test_colours_of_obj_vertices_up_to_255(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0 255 0 51\nv 1 0 0 0 255 0\nv 1 1 0 0 0 0\nv 0 1 0 0 0 0\n" + SQUARE)
    np.testing.assert_allclose(read_obj(tmp_path / "a.obj").colours[0], [1, 0, 0.2])


@pytest.mark.parametrize("colour", ["", " 1 1 1", " 1.0"])
def test_obj_vertices_without_colours_or_all_white_have_those_of_materials(tmp_path, colour):
    places = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]
    (tmp_path / "a.obj").write_text("".join(f"v {place}{colour}\n" for place in places) + SQUARE)
    assert read_obj(tmp_path / "a.obj").colours is None


def test_a_damaged_colour_of_an_obj_vertex_is_refused(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0 red 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n" + SQUARE)
    with pytest.raises(InputError, match="export the mesh as OBJ again"):
        read_obj(tmp_path / "a.obj")
