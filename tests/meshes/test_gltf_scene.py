import json

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion_faces.characters import gltf_scene, meshopt
from meshes.gltf import (
    OPEN,
    POSITIONS,
    WIDE,
    data_uri,
    document,
    glb,
    packed_attributes,
    with_array,
    with_skin,
)  # fmt: skip
from meshes.heads import shaped


def _read(tmp_path, content, binary=None, name="head.glb"):
    path = tmp_path / name
    path.write_bytes(glb(content, binary) if binary is not None else json.dumps(content).encode())
    return gltf_scene.read_gltf(path)


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
    binary, _ = with_array(content, binary, rows, "SCALAR")
    binary, _ = with_array(content, binary, moved, "VEC3")
    sparse = {"count": 2, "indices": {"bufferView": 4, "componentType": 5123}, "values": {"bufferView": 5}}
    content["accessors"][1] = {"componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse}
    mesh = _read(tmp_path, content, binary)
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
    content["nodes"] = [{"mesh": 0, "skin": 0, "translation": [9] * 3}, {"translation": [0, 1, 0]}, {"scale": [2] * 3}]
    content["scenes"] = [{"nodes": [0, 1, 2]}]
    content["skins"] = [{"joints": [1, 2]}]
    mesh = _read(tmp_path, content, with_skin(content, binary, joints, weights))
    np.testing.assert_allclose(mesh.vertices, [[0, 1, 0], [1, 1, 0], [2, 2, 0], [0, 2, 0]], atol=1e-6)
    np.testing.assert_allclose(shaped(mesh, {"jawOpen": 1})[2], [2, 3, 0], atol=1e-6)


@pytest.mark.parametrize("version", ["VRM", "VRMC_vrm"])
def test_expressions_of_vrm_and_characters_of_vrm_0_turned_to_the_front(tmp_path, version):
    content, binary = document()
    bind = {"node": 0, "index": 0, "weight": 0.5}
    group = {"presetName": "a", "name": "A", "binds": [{"mesh": 0, "index": 0, "weight": 50}]}
    content["extensions"] = {version: {
        "VRM": {"blendShapeMaster": {"blendShapeGroups": [group]}},
        "VRMC_vrm": {"expressions": {"preset": {"aa": {"morphTargetBinds": [bind]}}}},
    }[version]}  # fmt: skip
    mesh = _read(tmp_path, content, binary, "head.vrm")
    assert mesh.shape_names == ("jawOpen", "mouthWide", "aa")
    front = [-1, 1, -1] if version == "VRM" else [1, 1, 1]
    np.testing.assert_allclose(mesh.vertices, POSITIONS * front, atol=1e-7)
    np.testing.assert_allclose(shaped(mesh, {"aa": 1}), (POSITIONS + OPEN / 2) * front, atol=1e-7)


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
    content, binary = document()
    change(content)
    with pytest.raises(InputError, match=message) as refused:
        _read(tmp_path, content, binary)
    assert str(tmp_path) in str(refused.value)


@pytest.mark.parametrize("content", [b"glTF", b"glTF\2\0\0\0\xff\xff\xff\xff" + b"\0" * 20, b"{", b"[]", b"\xff\xfe"])
def test_what_is_no_gltf_is_refused(tmp_path, content):
    (tmp_path / "head.glb").write_bytes(content)
    with pytest.raises(InputError, match=r"head\.glb"):
        gltf_scene.read_gltf(tmp_path / "head.glb")


def test_attributes_come_back():
    for count, stride in ((1, 4), (16, 8), (300, 12), (700, 36)):
        rng = np.random.default_rng(count)
        smooth = np.cumsum(rng.integers(-2, 3, (count, stride)), axis=0)
        smooth[:, ::3] = rng.integers(0, 256, (count, len(range(0, stride, 3))))
        elements = (smooth & 255).astype(np.uint8)
        np.testing.assert_array_equal(meshopt.decode_attributes(packed_attributes(elements), count, stride), elements)


TAIL = bytes.fromhex("76 87 56 67 78 a9 86 65 89 68 98 01 69 00 00")
"""The table at the end of each stream of triangles."""


@pytest.mark.parametrize(
    ("start", "triangles"),
    [
        ("e0 f0 10 fe ff f0 0c ff 02 02 02 00", [[0, 1, 2], [2, 1, 3], [4, 6, 5], [7, 8, 9]]),
        ("e1 f0 10 fe 1f 3d 00 0a 00", [[0, 1, 2], [2, 1, 3], [0, 1, 2], [2, 1, 5], [2, 1, 4]]),
    ],
)
def test_triangles_of_both_versions_indices_and_exponents(start, triangles):
    """Streams of the reference implementation (meshoptimizer): fresh, shared, repeated and arbitrary vertices."""
    stream = bytes.fromhex(start) + TAIL
    assert meshopt.decode_triangles(stream, 3 * len(triangles)).reshape(-1, 3).tolist() == triangles
    stream = bytes.fromhex("d1 00 04 cd 01 04 07 98 1f 00 00 00 00")
    assert meshopt.decode_indices(stream, 6).tolist() == [0, 1, 51, 2, 49, 1000]
    stored = np.array([[3 | (-1 & 0xFF) << 24, (-5 & 0xFFFFFF) | 2 << 24]], np.uint32).view(np.uint8)
    np.testing.assert_allclose(meshopt.decode_exponents(stored), [[1.5, -20.0]])


def test_damaged_streams_are_refused():
    for stream in (b"", b"\xa0", b"\xb0" + b"\0" * 60, b"\xa1" + b"\0" * 60, b"\xa0" + b"\xff" * 40):
        with pytest.raises(InputError, match=r"export it (again|without)"):
            meshopt.decode_attributes(stream, 100, 8)
    for decode in (meshopt.decode_triangles, meshopt.decode_indices):
        with pytest.raises(InputError):
            decode(b"\xe1\xff\xff" + b"\x80" * 20, 300)
