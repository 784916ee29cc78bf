"""A user's own .glb gets an animation; all else in it stays."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from lipmotion.meshes.files.character_files import read_character
from lipmotion.meshes.files.gltf_document import GltfArrays, read_gltf_document
from lipmotion.meshes.files.gltf_writer import write_animated_gltf
from lipmotion.types import WEIGHT, Channel, Motion
from meshes import gltf
from meshes.heads import head, write_glb


def weights(*names: str) -> Motion:
    values = np.random.default_rng(4).random((9, len(names)))
    return Motion(values, 30.0, tuple(Channel(name, WEIGHT) for name in names))


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
    assert write_animated_gltf(tmp_path / "a.glb", original, weights("jawOpen", "mouthFunnel"), "a.wav")
    before, after = read_gltf_document(original), read_gltf_document(tmp_path / "a.glb")
    for name in ("images", "meshes", "materials", "nodes"):
        assert after.items(name) == before.items(name)
    assert after.json["asset"] == before.json["asset"]
    assert [each["name"] for each in after.json["animations"]] == ["speech", "dance"]
    assert after.json["accessors"][: len(before.json["accessors"])] == before.json["accessors"]
    assert after.buffers[0][: len(before.buffers[0])] == before.buffers[0]
    assert after.json["scenes"][0]["extras"] == {"audio": {"uri": "a.wav", "start_s": 0.0}}
    assert read_character(tmp_path / "a.glb").shape_names == head().shape_names


def test_the_animation_has_the_weights(original: Path, tmp_path: Path) -> None:
    moved = weights("jawOpen", "mouthFunnel")
    assert write_animated_gltf(tmp_path / "a.glb", original, moved)
    document = read_gltf_document(tmp_path / "a.glb")
    sampler = document.json["animations"][0]["samplers"][0]
    arrays = GltfArrays(document)
    assert arrays.floats(sampler["input"], 1)[:, 0] == pytest.approx(moved.time_s, abs=1e-6)
    stored = arrays.floats(sampler["output"], 1).reshape(9, -1)
    for column, name in enumerate(head().shape_names):
        wanted = moved[name] if name in moved.names else np.zeros(9)
        assert stored[:, column] == pytest.approx(wanted, abs=1e-6)


def test_held_weights_change_at_once(original: Path, tmp_path: Path) -> None:
    moved = Motion(np.array([[0.0], [0.0], [1.0]]), 10.0, (Channel("jawOpen", WEIGHT),))
    assert write_animated_gltf(tmp_path / "a.glb", original, moved, stepped=["jawOpen"])
    document = read_gltf_document(tmp_path / "a.glb")
    sampler = document.json["animations"][0]["samplers"][0]
    assert GltfArrays(document).floats(sampler["input"], 1)[:, 0] == pytest.approx([0, 0.1, 0.199, 0.2])
    stored = GltfArrays(document).floats(sampler["output"], 1).reshape(4, -1)
    assert stored[:, head().shape_names.index("jawOpen")] == pytest.approx([0, 0, 0, 1])


def test_weights_of_what_is_no_morph_target_are_left_to_another_writer(original: Path, tmp_path: Path) -> None:
    assert not write_animated_gltf(tmp_path / "a.glb", original, weights("jawOpen", "vowel_aa"))
    assert not (tmp_path / "a.glb").exists()


def test_a_file_with_its_buffer_elsewhere_is_left_to_another_writer(tmp_path: Path) -> None:
    content, binary = gltf.document()
    content["buffers"][0]["uri"] = gltf.data_uri(binary)
    path = tmp_path / "elsewhere.gltf"
    path.write_text(json.dumps(content))
    assert not write_animated_gltf(tmp_path / "a.glb", path, weights("target 0"))
