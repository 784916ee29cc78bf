"""What is written as glb is read again, with its blendshapes; the animation has the weights."""

from __future__ import annotations

import json

import numpy as np
import pytest

from lipmotion.errors import ExportError
from lipmotion.meshes.files.character_files import read_character
from lipmotion.meshes.files.gltf_document import GltfArrays, read_gltf_document
from lipmotion.meshes.files.gltf_writer import find_named_sound, sound_extras
from lipmotion.types import WEIGHT, Channel, Motion
from meshes.heads import head, shaped, write_glb


@pytest.fixture
def weights():
    values = np.stack([np.linspace(0, 1, 7), np.linspace(0.5, 0, 7)], axis=1)
    return Motion(values, 25.0, (Channel("mouthPucker", WEIGHT), Channel("jawOpen", WEIGHT)))


def test_a_mesh_comes_back(tmp_path):
    mesh = head()
    write_glb(tmp_path / "head.glb", mesh)
    read = read_character(tmp_path / "head.glb")
    assert read.shape_names == mesh.shape_names
    for name in ("jawOpen", "mouthSmileLeft", "eyeBlinkLeft"):
        written, again = shaped(mesh, {name: 1.0})[mesh.triangles], shaped(read, {name: 1.0})[read.triangles]
        np.testing.assert_allclose(again, written, atol=1e-5)


def test_the_animation_has_the_weights(tmp_path, weights):
    mesh = head()
    write_glb(tmp_path / "head.glb", mesh, weights)
    document = read_gltf_document(tmp_path / "head.glb")
    sampler = document.json["animations"][0]["samplers"][0]
    arrays = GltfArrays(document)
    np.testing.assert_allclose(arrays.floats(sampler["input"], 1)[:, 0], weights.time_s, atol=1e-6)
    stored = arrays.floats(sampler["output"], 1).reshape(7, -1)
    np.testing.assert_allclose(stored[:, mesh.shape_names.index("jawOpen")], weights["jawOpen"], atol=1e-6)
    np.testing.assert_allclose(stored[:, mesh.shape_names.index("mouthFunnel")], 0, atol=1e-6)


def test_a_channel_that_is_no_shape_is_refused(tmp_path):
    other = Motion(np.zeros((3, 1)), 25.0, (Channel("opening"),))
    with pytest.raises(ExportError, match="no blendshape 'opening'"):
        write_glb(tmp_path / "head.glb", head(), other)
    assert not list(tmp_path.iterdir())


def test_colours_of_vertices_come_back(tmp_path):
    mesh = head(shapes=False)
    colours = np.random.default_rng(0).random(mesh.vertices.shape)
    painted = type(mesh)(mesh.vertices, mesh.triangles, mesh.parts, colours=colours)
    write_glb(tmp_path / "head.glb", painted)
    document = read_gltf_document(tmp_path / "head.glb")
    primitive = document.json["meshes"][0]["primitives"][0]
    assert "COLOR_0" in primitive["attributes"]


@pytest.mark.parametrize(
    ("extras", "found"),
    [(sound_extras("../a b/#1 50%.wav", 0.5), "../a b/#1 50%.wav"),
     ({"audio": {"uri": "ä.wav"}}, "ä.wav"),
     (sound_extras("a.wav", 2**63), None),
     ({"audio": {"uri": "https://example.org/a.wav"}}, None),
     ({"audio": {"uri": "file:a.wav"}}, None),
     ({"audio": {"uri": "/a.wav"}}, None),
     ({"audio": {"uri": "a%00.wav"}}, None),
     ({"audio": {"uri": 7}}, None),
     ({"audio": "a.wav"}, None),
     (["audio"], None)],
)  # fmt: skip
def test_paths_from_the_folder_of_the_file_count(tmp_path, extras, found):
    text = json.dumps({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"extras": extras}]})
    (tmp_path / "a.gltf").write_text(text, encoding="utf-8")
    named = find_named_sound(tmp_path / "a.gltf")
    assert (named and named[0]) == (found and tmp_path / found)
