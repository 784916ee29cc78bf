"""OBJ files and folders of them; what is written is read again."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.meshes.files.character_files import read_character, read_obj
from meshes.heads import head, shaped
from meshes.obj_writing import write_obj

QUAD = (
    "mtllib look.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    "usemtl skin\nf 1/1 2/2 3/3 4/4\n"
)


def _obj(tmp_path, text, name="head.obj"):
    (tmp_path / name).write_text(text)
    return tmp_path / name


def test_polygons_become_triangles_and_materials_parts(tmp_path):
    (tmp_path / "look.mtl").write_text("newmtl skin\nKd 0.5 0.25 2\nNs 60\n")
    mesh = read_obj(_obj(tmp_path, QUAD + "usemtl teeth\nf -1 -2 -3\n"))
    assert [(part.name, part.first, part.stop) for part in mesh.parts] == [("skin", 0, 2), ("teeth", 2, 3)]
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [3, 2, 1]]
    assert mesh.parts[0].material.colour == (0.5, 0.25, 1.0)
    assert mesh.parts[0].material.gloss == pytest.approx(0.5)


def test_texture_coordinates_belong_to_corners(tmp_path):
    mesh = read_obj(_obj(tmp_path, QUAD))
    assert mesh.uv is not None
    assert mesh.uv[1].tolist() == [[0, 0], [1, 1], [0, 1]]


def test_parts_that_are_written_alternately_are_put_together(tmp_path):
    text = QUAD + "usemtl teeth\nf 1 2 3\nusemtl skin\nf 2 3 4\n"
    mesh = read_obj(_obj(tmp_path, text))
    assert [(part.name, part.stop - part.first) for part in mesh.parts] == [("skin", 3), ("teeth", 1)]


def test_a_folder_has_a_neutral_mesh_and_shapes(tmp_path):
    mesh = head()
    write_obj(tmp_path / "my_neutral.obj", mesh)
    for name in ("jawOpen", "mouthPucker"):
        write_obj(tmp_path / f"{name}.obj", mesh, shaped(mesh, {name: 1.0}))
    write_obj(tmp_path / "older_person.obj", mesh)
    read = read_character(tmp_path)
    assert read.shape_names == ("jawOpen", "mouthPucker")
    np.testing.assert_allclose(shaped(read, {"jawOpen": 1}), shaped(mesh, {"jawOpen": 1}), atol=1e-3)


def test_what_is_written_is_read(tmp_path):
    mesh = head(shapes=False)
    write_obj(tmp_path / "head.obj", mesh)
    read = read_character(tmp_path / "head.obj")
    np.testing.assert_allclose(read.vertices, mesh.vertices, atol=1e-7)
    assert read.triangles.tolist() == mesh.triangles.tolist()
    assert [part.name for part in read.parts] == ["face", "teeth"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("v 0 0 0\n", "no polygons"),
        ("v 0 0\nf 1 1 1\n", "no vertex of 3 numbers"),
        ("v 0 0 nan\nf 1 1 1\n", "not finite"),
        ("v 0 0 zero\nf 1 1 1\n", "zero"),
        (QUAD + "f 1 2 9\n", "names vertex 9 of 4 in line 12"),
        (QUAD + "f 0 1 2\n", "names vertex 0"),
        (QUAD + "f 1 2\n", "2 corners"),
        (QUAD + "f one two three\n", "line 12"),
    ],
)
def test_damaged_files_are_refused(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read_obj(_obj(tmp_path, text))


def test_libraries_elsewhere_are_not_read(tmp_path):
    (tmp_path / "look.mtl").write_text("newmtl skin\nKd 1 0 0\n")
    (tmp_path / "deeper").mkdir()
    mesh = read_obj(_obj(tmp_path / "deeper", QUAD.replace("look.mtl", "../look.mtl")))
    assert mesh.parts[0].material.colour == (0.8, 0.8, 0.8)


def test_a_folder_without_a_neutral_mesh_is_refused(tmp_path):
    _obj(tmp_path, QUAD, "jawOpen.obj")
    with pytest.raises(InputError, match="0 OBJ files have 'neutral'"):
        read_character(tmp_path)


def test_a_shape_of_other_vertices_is_refused(tmp_path):
    _obj(tmp_path, QUAD, "neutral.obj")
    _obj(tmp_path, QUAD + "v 9 9 9\n", "jawOpen.obj")
    with pytest.raises(InputError, match="5 vertices, required 4"):
        read_character(tmp_path)


@pytest.mark.parametrize("name", ["head.fbx", "head"])
def test_other_files_are_refused(tmp_path, name):
    with pytest.raises(InputError, match=r"one of \.glb \.gltf \.vrm \.obj"):
        read_character(_obj(tmp_path, QUAD, name))


def test_names_that_no_file_has_are_as_missing_ones(tmp_path):
    for name in ("", "é" * 200, "a" * 5000, "..", "."):
        mesh = read_obj(_obj(tmp_path, QUAD.replace("look.mtl", name)))
        assert [part.name for part in mesh.parts] == ["skin"]
    for name in ("é" * 200, "a" * 5000, ".."):
        (tmp_path / "look.mtl").write_text(f"newmtl skin\nmap_Kd {name}\nmap_Kd\n", encoding="utf-8")
        with pytest.warns(UserWarning, match="not in the same folder"):
            assert read_obj(_obj(tmp_path, QUAD)).parts[0].material.texture is None
