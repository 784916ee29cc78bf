import json
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion import errors, types
from lipmotion_faces.characters import character_files, gltf_document, gltf_writer
from meshes import gltf
from meshes.heads import head, shaped, write_glb


def test_a_mesh_comes_back(tmp_path):
    mesh = head()
    write_glb(tmp_path / "head.glb", mesh)
    read = character_files.read_character(tmp_path / "head.glb")
    assert read.shape_names == mesh.shape_names
    for name in ("jawOpen", "mouthSmileLeft", "eyeBlinkLeft"):
        written, again = shaped(mesh, {name: 1.0})[mesh.triangles], shaped(read, {name: 1.0})[read.triangles]
        np.testing.assert_allclose(again, written, atol=1e-5)


def test_colours_of_vertices_are_written_and_a_channel_that_is_no_shape_is_refused(tmp_path):
    other = types.Motion(np.zeros((3, 1)), 25.0, (types.Channel("opening"),))
    with pytest.raises(errors.ExportError, match="no blendshape 'opening'"):
        write_glb(tmp_path / "head.glb", head(), other)
    assert not list(tmp_path.iterdir())
    mesh = head(shapes=False)
    colours = np.random.default_rng(0).random(mesh.vertices.shape)
    write_glb(tmp_path / "head.glb", replace(mesh, colours=colours))
    document = gltf_document.read_gltf_document(tmp_path / "head.glb")
    assert "COLOR_0" in document.json["meshes"][0]["primitives"][0]["attributes"]


@pytest.mark.parametrize(
    ("extras", "found"),
    [(gltf_writer.sound_extras("../a b/#1 50%.wav", 0.5), "../a b/#1 50%.wav"),
     ({"audio": {"uri": "ä.wav"}}, "ä.wav"),
     (gltf_writer.sound_extras("a.wav", 2**63), None),
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
    named = gltf_writer.find_named_sound(tmp_path / "a.gltf")
    assert (named and named[0]) == (found and tmp_path / found)


def weights(*names: str) -> types.Motion:
    values = np.random.default_rng(4).random((9, len(names)))
    return types.Motion(values, 30.0, tuple(types.Channel(name, types.WEIGHT) for name in names))


@pytest.fixture
def original(tmp_path: Path) -> Path:
    """A head of which things are known that this program does not know, and with an animation already."""
    write_glb(tmp_path / "first.glb", head(), weights("mouthPucker"))
    content = (tmp_path / "first.glb").read_bytes()
    (size,) = struct.unpack_from("<I", content, 12)
    document = json.loads(content[20 : 20 + size])
    document["images"] = [{"name": "skin", "mimeType": "image/png", "bufferView": 0}]
    document["asset"]["extras"] = {"by": "somebody – Größe"}
    document["animations"][0]["name"] = "dance"
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = content[20 + size :]
    header = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(body))
    path = tmp_path / "original.glb"
    path.write_bytes(header + struct.pack("<II", len(text), 0x4E4F534A) + text + body)
    return path


def test_everything_stays_and_the_animation_comes_first(original: Path, tmp_path: Path) -> None:
    assert gltf_writer.write_animated_gltf(tmp_path / "a.glb", original, weights("jawOpen", "mouthFunnel"), "a.wav")
    before, after = gltf_document.read_gltf_document(original), gltf_document.read_gltf_document(tmp_path / "a.glb")
    for name in ("images", "meshes", "materials", "nodes"):
        assert after.items(name) == before.items(name)
    assert after.json["asset"] == before.json["asset"]
    assert [each["name"] for each in after.json["animations"]] == ["speech", "dance"]
    assert after.json["accessors"][: len(before.json["accessors"])] == before.json["accessors"]
    assert after.buffers[0][: len(before.buffers[0])] == before.buffers[0]
    assert after.json["scenes"][0]["extras"] == {"audio": {"uri": "a.wav", "start_s": 0.0}}
    assert character_files.read_character(tmp_path / "a.glb").shape_names == head().shape_names


def written_curves(path: Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return the times of the first animation of a head, and its weights by name."""
    document = gltf_document.read_gltf_document(path)
    sampler, arrays = document.json["animations"][0]["samplers"][0], gltf_document.GltfArrays(document)
    times_s = arrays.floats(sampler["input"], 1)[:, 0]
    stored = arrays.floats(sampler["output"], 1).reshape(len(times_s), -1)
    return times_s, dict(zip(head().shape_names, stored.T, strict=True))


@pytest.mark.parametrize("added", [True, False])
def test_the_animation_has_the_weights(original: Path, tmp_path: Path, added: bool) -> None:
    moved = weights("jawOpen", "mouthFunnel")
    if added:
        assert gltf_writer.write_animated_gltf(tmp_path / "a.glb", original, moved)
    else:
        write_glb(tmp_path / "a.glb", head(), moved)
    times_s, stored = written_curves(tmp_path / "a.glb")
    assert times_s == pytest.approx(moved.time_s, abs=1e-6)
    for name, curve in stored.items():
        assert curve == pytest.approx(moved[name] if name in moved.names else np.zeros(9), abs=1e-6)


def test_held_weights_change_at_once(original: Path, tmp_path: Path) -> None:
    moved = types.Motion(np.array([[0.0], [0.0], [1.0]]), 10.0, (types.Channel("jawOpen", types.WEIGHT),))
    assert gltf_writer.write_animated_gltf(tmp_path / "a.glb", original, moved, stepped=["jawOpen"])
    times_s, stored = written_curves(tmp_path / "a.glb")
    assert times_s == pytest.approx([0, 0.1, 0.199, 0.2])
    assert stored["jawOpen"] == pytest.approx([0, 0, 0, 1])


def test_what_is_no_morph_target_and_buffers_elsewhere_are_left_to_another_writer(
    original: Path, tmp_path: Path
) -> None:
    content, binary = gltf.document()
    content["buffers"][0]["uri"] = gltf.data_uri(binary)
    (tmp_path / "elsewhere.gltf").write_text(json.dumps(content))
    for path, moved in ((original, weights("jawOpen", "vowel_aa")), (tmp_path / "elsewhere.gltf", weights("target 0"))):
        assert not gltf_writer.write_animated_gltf(tmp_path / "a.glb", path, moved)
        assert not (tmp_path / "a.glb").exists()
