import json
import os
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion import errors, types
from lipmotion.meshes.model.rig_tables import find_table
from lipmotion_faces.characters import character_files, file_limits, gltf_writer
from meshes.gltf import document, glb
from meshes.heads import REPORTED, head, shaped, write_glb, write_obj
from meshes.speech import motion, units

QUAD = (
    "mtllib look.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    "usemtl skin\nf 1/1 2/2 3/3 4/4\n"
)


def _obj(tmp_path, text, name="head.obj"):
    (tmp_path / name).write_text(text)
    return tmp_path / name


def test_polygons_become_triangles_and_materials_parts(tmp_path):
    (tmp_path / "look.mtl").write_text("newmtl skin\nKd 0.5 0.25 2\nNs 60\n")
    text = "\ufeff" + QUAD.replace("look.mtl", "C:\\old\\look.mtl") + "usemtl teeth\nf -1 -2 -3\n"
    mesh = character_files.read_obj(_obj(tmp_path, text))
    assert [(part.name, part.first, part.stop) for part in mesh.parts] == [("skin", 0, 2), ("teeth", 2, 3)]
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [3, 2, 1]]
    assert mesh.parts[0].material.colour == (0.5, 0.25, 1.0)
    assert mesh.parts[0].material.gloss == pytest.approx(0.5)


def test_parts_that_are_written_alternately_are_put_together(tmp_path):
    mesh = character_files.read_obj(_obj(tmp_path, QUAD + "usemtl teeth\nf 1 2 3\nusemtl skin\nf 2 3 4\n"))
    assert [(part.name, part.stop - part.first) for part in mesh.parts] == [("skin", 3), ("teeth", 1)]
    assert mesh.uv[1].tolist() == [[0, 0], [1, 1], [0, 1]]  # of corners, not of vertices


def test_a_folder_has_a_neutral_mesh_and_shapes(tmp_path):
    mesh = head()
    write_obj(tmp_path / "my_neutral.obj", mesh)
    for name in ("jawOpen", "mouthPucker"):
        write_obj(tmp_path / f"{name}.obj", mesh, shaped(mesh, {name: 1.0}))
    write_obj(tmp_path / "older_person.obj", mesh)
    read = character_files.read_character(tmp_path)
    assert read.shape_names == ("jawOpen", "mouthPucker")
    np.testing.assert_allclose(shaped(read, {"jawOpen": 1}), shaped(mesh, {"jawOpen": 1}), atol=1e-3)


@pytest.mark.parametrize("row", REPORTED["folders"], ids=[row["name"] for row in REPORTED["folders"]])
def test_folders_as_programs_write_them(tmp_path, recwarn, row):
    mesh = head()
    order = np.argsort(np.arange(len(mesh.vertices)) * row.get("step", 1) % len(mesh.vertices), kind="stable")
    write_obj(tmp_path / "neutral.obj", mesh)
    for name in ("jawOpen", "mouthPucker"):
        moved = row.get("scale", 1) * shaped(mesh, {name: 1.0}) + row.get("shift", 0)
        write_obj(tmp_path / f"{name}.obj", mesh, moved[order])
    if "error" in row:
        with pytest.raises(errors.InputError, match=row["error"]):
            character_files.read_character(tmp_path)
    else:
        read = character_files.read_character(tmp_path)
        np.testing.assert_allclose(shaped(read, {"jawOpen": 1}), shaped(mesh, {"jawOpen": 1}), atol=1e-3)
        said = [str(each.message) for each in recwarn]
        assert [bool(re.search(row.get("warns", "-"), each)) for each in said] == [True] * ("warns" in row)


@pytest.mark.parametrize("row", REPORTED["heads"], ids=[row["name"] for row in REPORTED["heads"]])
def test_heads_as_people_bring_them(tmp_path, recwarn, row):
    """The blendshapes that speech moves, those that it leaves alone, and what is said of the rest."""
    mesh = head()
    names, path = row.get("names") or {name: name for name in mesh.shape_names}, tmp_path / "head.glb"
    shapes = [
        replace(s, name=names[s.name], displacements=row.get("scale", {}).get(s.name, 1) * s.displacements)
        for s in mesh.shapes
        if s.name in names
    ]
    last = len(mesh.vertices) - 3 * ("teeth" in row)
    parts = [(s, s.rows >= last, "Teeth_") for s in shapes if "teeth" in row] + [(s, s.rows < last, "") for s in shapes]
    shapes = [replace(s, name=add + s.name, rows=s.rows[i], displacements=s.displacements[i]) for s, i, add in parts]
    write_glb(path, replace(mesh, vertices=shaped(mesh, row.get("rest", {})), shapes=tuple(shapes)))
    if "table" in row:
        find_table(path).write_text("control,source,gain,offset\n" + row["table"])
    character = character_files.load_character(path)
    weights = character.weights(motion(), units())
    assert character.shapes.style == row["style"]
    assert all(weights[name].max() > 0.1 for name in row["moves"])
    assert not {*row.get("still", ())} & {*weights.names}
    said = [str(each.message) for each in recwarn]
    assert [bool(re.search(row.get("warns", "-"), each)) for each in said] == [True] * ("warns" in row)


def test_both_sides_are_one_and_shapes_that_no_mouth_makes_or_of_the_other_side_are_named(tmp_path):
    mesh, path = head(), tmp_path / "a.glb"
    write_glb(path, replace(mesh, triangles=np.concatenate([mesh.triangles, mesh.triangles[:, ::-1]]), parts=()))
    assert "jawOpen" in character_files.load_character(path).shapes.names
    write_glb(path, replace(mesh, shapes=tuple(replace(s, displacements=99 * s.displacements) for s in mesh.shapes)))
    with pytest.raises(
        errors.InputError, match=r"'jawOpen' moves lips or chin by \d+ eye distances, required up to 2.5"
    ):
        character_files.load_character(path)
    other = {"Left": "Right", "Right": "Left"}
    swapped = [replace(s, name=re.sub("Left$|Right$", lambda side: other[side[0]], s.name)) for s in mesh.shapes]
    write_glb(path, replace(mesh, shapes=tuple(swapped)))
    with pytest.warns(UserWarning, match="blendshapes of the left move the right side"):
        character_files.load_character(path)


def test_what_is_written_is_read_but_no_library_elsewhere(tmp_path):
    mesh = head(shapes=False)
    write_obj(tmp_path / "head.obj", mesh)
    read = character_files.read_character(tmp_path / "head.obj")
    np.testing.assert_allclose(read.vertices, mesh.vertices, atol=1e-7)
    assert read.triangles.tolist() == mesh.triangles.tolist()
    assert [part.name for part in read.parts] == ["face", "teeth"]
    (tmp_path / "look.mtl").write_text("newmtl skin\nKd 1 0 0\n")
    (tmp_path / "deeper").mkdir()
    mesh = character_files.read_obj(_obj(tmp_path / "deeper", QUAD.replace("look.mtl", "../look.mtl")))
    assert mesh.parts[0].material.colour == (0.8, 0.8, 0.8)


def test_other_files_and_folders_are_refused(tmp_path):
    def refused(path, message):
        with pytest.raises(errors.InputError, match=message):
            character_files.read_character(path)

    for name in ("head.fbx", "head"):
        refused(_obj(tmp_path, QUAD, name), r"one of \.glb \.gltf \.vrm \.obj")
    _obj(tmp_path, QUAD, "jawOpen.obj")
    refused(tmp_path, "0 OBJ files have 'neutral'")
    _obj(tmp_path, QUAD + "v 9 9 9\n", "neutral.obj")
    refused(tmp_path, "4 vertices, required 5")


@pytest.mark.parametrize(("text", "message"), REPORTED["obj"])
def test_damaged_files_are_refused(tmp_path, text, message):
    with pytest.raises(errors.InputError, match=message):
        character_files.read_obj(_obj(tmp_path, text.replace("QUAD", QUAD)))


def test_names_that_no_file_has_are_as_missing_ones(tmp_path):
    for name in ("", "é" * 200, "a" * 5000, "..", "."):
        mesh = character_files.read_obj(_obj(tmp_path, QUAD.replace("look.mtl", name)))
        assert [part.name for part in mesh.parts] == ["skin"]
    for name in ("é" * 200, "a" * 5000, ".."):
        (tmp_path / "look.mtl").write_text(f"newmtl skin\nmap_Kd {name}\nmap_Kd\n", encoding="utf-8")
        with pytest.warns(UserWarning, match="not in the same folder"):
            assert character_files.read_obj(_obj(tmp_path, QUAD)).parts[0].material.texture is None


def test_a_budget_is_that_of_all_files_together(tmp_path: Path) -> None:
    budget = file_limits.Budget()
    budget.spend("vertices", file_limits.ALLOWANCE["vertices"])
    most = file_limits.ALLOWANCE["vertices"]
    with pytest.raises(errors.InputError, match=f"{most + 1} vertices, required at most {most}"):
        budget.spend("vertices", 1)
    budget.spend("bytes of files", file_limits.ALLOWANCE["bytes of files"] - 3)
    (tmp_path / "head.bin").write_bytes(b"four")
    with pytest.raises(errors.InputError, match="bytes of files"):
        budget.read_bytes(tmp_path / "head.bin", "buffer")


@pytest.mark.skipif(sys.platform == "win32", reason="pipes as POSIX has them")
def test_buffers_lead_to_no_pipe_folder_or_other_folder(tmp_path: Path) -> None:
    content, _ = document()
    os.mkfifo(tmp_path / "pipe.bin")
    (tmp_path / "loop.bin").symlink_to("loop.bin")
    for uri in ("pipe.bin", "loop.bin", "..", ".", "", "%2e%2e/x", "a/b.bin", "x" * 5000, "\ud800", "data:,x", "a\0b"):
        content["buffers"][0]["uri"] = uri
        (tmp_path / "head.gltf").write_text(json.dumps(content))
        with pytest.raises(errors.InputError):
            character_files.read_character(tmp_path / "head.gltf")


def test_lines_of_obj_are_counted_before_they_are_read(tmp_path: Path) -> None:
    path = tmp_path / "head.obj"
    wrong = {
        "lines, required at most": b"\n" * (file_limits.ALLOWANCE["lines"] + 1),
        "is no vertex of 3 numbers in line 2": b"#\nv\nv\n",
        "a line of 80001 bytes": b"f" + b" 1" * 40_000,
        "a polygon of 1001 corners": b"v 0 0 0\nf" + b" 1" * 1001,
        "2001 parts": b"v 0 0 0\n" + b"".join(b"g %d\nf 1 1 1\n" % n for n in range(2001)),
    }
    for message, content in wrong.items():
        path.write_bytes(content)
        with pytest.raises(errors.InputError, match=message):
            character_files.read_character(path)


def test_a_file_without_scenes_is_animated(tmp_path: Path) -> None:
    content, binary = document()
    del content["scene"], content["scenes"]
    (tmp_path / "head.glb").write_bytes(glb(content, binary))
    moved = types.Motion(np.zeros((3, 1)), 30.0, (types.Channel("jawOpen", types.WEIGHT),))
    assert gltf_writer.write_animated_gltf(tmp_path / "a.glb", tmp_path / "head.glb", moved, "a.wav")
    assert len(character_files.read_character(tmp_path / "a.glb").shapes) == 2
