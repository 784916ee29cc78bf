"""glTF files are read wherever their numbers are kept; damaged ones are refused with a message."""

from __future__ import annotations

import copy
import json
from contextlib import suppress

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.meshes.files.gltf_scene import read_gltf
from meshes.gltf import INDICES, OPEN, POSITIONS, WIDE, data_uri, document, glb, packed_attributes
from meshes.heads import shaped


def _read(tmp_path, content, binary=None, name="head.glb"):
    path = tmp_path / name
    path.write_bytes(glb(content, binary) if binary is not None else json.dumps(content).encode())
    return read_gltf(path)


def test_a_mesh_with_morph_targets(tmp_path):
    mesh = _read(tmp_path, *document())
    np.testing.assert_allclose(mesh.vertices, POSITIONS, atol=1e-7)
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.shape_names == ("jawOpen", "mouthWide")
    assert mesh.parts[0].name == "head"
    np.testing.assert_allclose(shaped(mesh, {"jawOpen": 0.5, "mouthWide": 1}), POSITIONS + OPEN / 2 + WIDE, atol=1e-7)


@pytest.mark.parametrize("place", ["data", "file"])
def test_buffers_outside_a_glb(tmp_path, place):
    content, binary = document()
    (tmp_path / "head data.bin").write_bytes(binary)
    content["buffers"][0]["uri"] = data_uri(binary) if place == "data" else "head%20data.bin"
    assert len(_read(tmp_path, content, name="head.gltf").triangles) == 2


def test_nodes_turn_scale_and_shift(tmp_path):
    content, binary = document()
    half = np.sqrt(0.5)
    content["nodes"] = [
        {"children": [1], "translation": [0, 10, 0]},
        {"mesh": 0, "rotation": [0, 0, half, half], "scale": [2, 2, 2]},
    ]
    mesh = _read(tmp_path, content, binary)
    turned = np.stack([-2 * POSITIONS[:, 1], 2 * POSITIONS[:, 0] + 10, POSITIONS[:, 2]], axis=1)
    np.testing.assert_allclose(mesh.vertices, turned, atol=1e-6)
    np.testing.assert_allclose(shaped(mesh, {"jawOpen": 1})[2] - mesh.vertices[2], [-1, 0, 0], atol=1e-6)


def test_quantised_positions(tmp_path):
    content, binary = document()
    content["extensionsRequired"] = ["KHR_mesh_quantization"]
    small = np.zeros((4, 4), "<i2")
    small[:, :3] = np.round(POSITIONS * 32767)
    content["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": 32, "byteStride": 8})
    content["accessors"][0] = {"bufferView": 4, "componentType": 5122, "count": 4, "type": "VEC3", "normalized": True}
    content["nodes"][0]["scale"] = [3, 3, 3]
    mesh = _read(tmp_path, content, binary + small.tobytes())
    np.testing.assert_allclose(mesh.vertices, 3 * POSITIONS, atol=1e-6)


def test_sparse_targets(tmp_path):
    content, binary = document()
    rows, moved = np.array([2, 3], "<u2"), OPEN[2:]
    content["bufferViews"] += [
        {"buffer": 0, "byteOffset": len(binary), "byteLength": 4},
        {"buffer": 0, "byteOffset": len(binary) + 4, "byteLength": 24},
    ]
    sparse = {"count": 2, "indices": {"bufferView": 4, "componentType": 5123}, "values": {"bufferView": 5}}
    content["accessors"][1] = {"componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse}
    mesh = _read(tmp_path, content, binary + rows.tobytes() + moved.tobytes())
    np.testing.assert_allclose(shaped(mesh, {"jawOpen": 1}), POSITIONS + OPEN, atol=1e-7)


def test_compressed_attributes(tmp_path):
    content, binary = document()
    stored = np.ascontiguousarray(POSITIONS).view(np.uint8).reshape(4, 12)
    packed = packed_attributes(stored)
    extension = {"buffer": 0, "byteOffset": len(binary), "byteLength": len(packed), "byteStride": 12, "count": 4}
    content["bufferViews"][0]["extensions"] = {"EXT_meshopt_compression": extension | {"mode": "ATTRIBUTES"}}
    content["bufferViews"][0]["buffer"] = 1
    content["buffers"].append({"byteLength": 48})
    mesh = _read(tmp_path, content, binary + packed)
    np.testing.assert_allclose(mesh.vertices, POSITIONS, atol=1e-7)


def test_skins_at_rest(tmp_path):
    content, binary = document()
    joints, weights = np.zeros((4, 4), np.uint8), np.zeros((4, 4), "<f4")
    joints[2:, 0], weights[:, 0] = 1, 1
    content["nodes"] = [
        {"mesh": 0, "skin": 0, "translation": [9, 9, 9]},
        {"translation": [0, 1, 0]},
        {"scale": [2, 2, 2]},
    ]
    content["scenes"] = [{"nodes": [0, 1, 2]}]
    content["skins"] = [{"joints": [1, 2]}]
    start = len(binary)
    content["bufferViews"] += [
        {"buffer": 0, "byteOffset": start, "byteLength": 16},
        {"buffer": 0, "byteOffset": start + 16, "byteLength": 64},
    ]
    content["accessors"] += [
        {"bufferView": 4, "componentType": 5121, "count": 4, "type": "VEC4"},
        {"bufferView": 5, "componentType": 5126, "count": 4, "type": "VEC4"},
    ]
    content["meshes"][0]["primitives"][0]["attributes"] |= {"JOINTS_0": 4, "WEIGHTS_0": 5}
    mesh = _read(tmp_path, content, binary + joints.tobytes() + weights.tobytes())
    np.testing.assert_allclose(mesh.vertices, [[0, 1, 0], [1, 1, 0], [2, 2, 0], [0, 2, 0]], atol=1e-6)
    np.testing.assert_allclose(shaped(mesh, {"jawOpen": 1})[2], [2, 3, 0], atol=1e-6)


def test_expressions_of_vrm(tmp_path):
    content, binary = document()
    bind = {"node": 0, "index": 0, "weight": 0.5}
    content["extensions"] = {"VRMC_vrm": {"expressions": {"preset": {"aa": {"morphTargetBinds": [bind]}}}}}
    mesh = _read(tmp_path, content, binary, "head.vrm")
    assert mesh.shape_names == ("jawOpen", "mouthWide", "aa")
    np.testing.assert_allclose(shaped(mesh, {"aa": 1}), POSITIONS + OPEN / 2, atol=1e-7)


def test_characters_of_vrm_0_are_turned_to_the_front(tmp_path):
    content, binary = document()
    group = {"presetName": "a", "name": "A", "binds": [{"mesh": 0, "index": 1, "weight": 100}]}
    content["extensions"] = {"VRM": {"blendShapeMaster": {"blendShapeGroups": [group]}}}
    mesh = _read(tmp_path, content, binary, "head.vrm")
    np.testing.assert_allclose(mesh.vertices, POSITIONS * [-1, 1, -1], atol=1e-7)
    np.testing.assert_allclose(shaped(mesh, {"aa": 1}), (POSITIONS + WIDE) * [-1, 1, -1], atol=1e-7)


def _changed(change):
    content, binary = document()
    content = copy.deepcopy(content)
    change(content)
    return content, binary


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c["asset"].update(version="1.0"), "version '1.0', required 2.0"),
        (lambda c: c.pop("asset"), "asset is missing"),
        (lambda c: c.update(extensionsRequired=["KHR_draco_mesh_compression"]), "Draco"),
        (lambda c: c.update(extensionsRequired=["EXT_unheard_of"]), "'EXT_unheard_of', which is not read"),
        (lambda c: c["accessors"][0].update(count=5), "leads out"),
        (lambda c: c["accessors"][0].update(count=10**12), "at most"),
        (lambda c: c["accessors"][0].update(count=-1), "required a whole number"),
        (lambda c: c["accessors"][0].update(byteOffset=2**40), "leads out"),
        (lambda c: c["accessors"][3].update(count=5), "triangles of vertices"),
        (lambda c: c["accessors"][0].update(type="VEC2"), "required 3 numbers"),
        (lambda c: c["bufferViews"][0].update(byteLength=10**9), "refers to bytes"),
        (lambda c: c["buffers"][0].update(uri="../secret.bin"), "same folder"),
        (lambda c: c["buffers"][0].update(uri="data:;base64,@@@"), "base64"),
        (lambda c: c["nodes"][0].update(children=[0]), "twice"),
        (lambda c: c["nodes"][0].update(mesh=7), r"nodes\[0\].mesh is 7, required the number of one of its 1 meshes"),
        (lambda c: c["nodes"][0].update(scale=[1, "two", 3]), r"nodes\[0\].scale\[1\] is 'two', required a number"),
        (lambda c: c["meshes"][0]["primitives"][0].update(mode=1), "no triangles"),
        (lambda c: c["meshes"][0]["primitives"][0].update(targets=[{"POSITION": 3}] * 2), "moves 6 of 4 vertices"),
        (lambda c: c.update(materials={}), "materials is an object, required a list"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, change, message):
    with pytest.raises(InputError, match=message) as refused:
        _read(tmp_path, *_changed(change))
    assert str(tmp_path) in str(refused.value)


@pytest.mark.parametrize("content", [b"glTF", b"glTF\2\0\0\0\xff\xff\xff\xff" + b"\0" * 20, b"{", b"[]", b"\xff\xfe"])
def test_what_is_no_gltf_is_refused(tmp_path, content):
    (tmp_path / "head.glb").write_bytes(content)
    with pytest.raises(InputError, match=r"head\.glb"):
        read_gltf(tmp_path / "head.glb")


def test_changed_bytes_are_read_or_refused(tmp_path):
    content, binary = document()
    whole = np.frombuffer(glb(content, binary), np.uint8)
    rng = np.random.default_rng(1)
    path = tmp_path / "head.glb"
    for _ in range(150):
        changed = whole.copy()
        changed[rng.integers(0, len(whole), 3)] = rng.integers(0, 256, 3)
        path.write_bytes(changed[: len(changed) - int(rng.integers(0, 3)) * 7].tobytes())
        with suppress(InputError):
            assert len(read_gltf(path).triangles) > 0


def test_the_square_has_the_indices_that_it_was_written_with():
    assert INDICES.tolist() == [0, 1, 2, 0, 2, 3]
