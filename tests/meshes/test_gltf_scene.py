import json
import struct
from dataclasses import replace
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion import errors, formats, read_motion, types
from lipmotion.errors import InputError
from lipmotion.types import WEIGHT, Channel, Motion
from lipmotion_faces.characters import character_files, gltf_document, gltf_scene, gltf_writer
from meshes import gltf
from meshes.gltf import OPEN, POSITIONS, WIDE, data_uri, document, glb, with_array, with_skin
from meshes.heads import REPORTED, head, shaped, write_glb


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


def test_a_mirrored_node_turns_its_triangles(tmp_path):
    content, binary = document()
    content["nodes"][0]["scale"] = [-1, 1, 1]
    mesh = _read(tmp_path, content, binary)
    assert mesh.triangles.tolist() == [[2, 1, 0], [3, 2, 0]]
    np.testing.assert_allclose(mesh.vertices, POSITIONS * (-1, 1, 1), atol=1e-7)


@pytest.mark.parametrize(
    ("mode", "indices", "triangles"),
    [(5, [0, 1, 3, 2, 2], [[0, 1, 3], [1, 2, 3]]), (6, [0, 1, 2, 3], [[1, 2, 0], [2, 3, 0]])],
)
def test_strips_and_fans_are_triangles(tmp_path, mode, indices, triangles):
    content, binary = document()
    binary, number = with_array(content, binary, np.array(indices, "<u2"), "SCALAR")
    content["meshes"][0]["primitives"][0] |= {"indices": number, "mode": mode}
    assert _read(tmp_path, content, binary).triangles.tolist() == triangles


@pytest.mark.parametrize("holder", ["meshes", "nodes"])
def test_sliders_of_the_body_stay_and_a_pose_of_the_face_does_not(tmp_path, holder):
    content, binary = document()
    content["meshes"][0] |= {"extras": {"targetNames": ["jawOpen", "bodyFat"]}, "weights": [0.0, 0.0]}
    content[holder][0]["weights"] = [0.7, 0.5]
    mesh = _read(tmp_path, content, binary)
    np.testing.assert_allclose(mesh.vertices, POSITIONS + WIDE / 2, atol=1e-7)
    assert gltf_writer.write_animated_gltf(tmp_path / "a.glb", tmp_path / "head.glb", weights("jawOpen"))
    written = gltf_document.read_gltf_document(tmp_path / "a.glb")
    output = written.json["animations"][0]["samplers"][0]["output"]
    stored = gltf_document.GltfArrays(written).read_floats(output, 1).reshape(9, 2)
    np.testing.assert_allclose(stored, np.stack([weights("jawOpen")["jawOpen"], np.full(9, 0.5)], 1), atol=1e-6)


def test_quantised_positions(tmp_path):
    content, binary = document()
    content["extensionsRequired"] = ["KHR_mesh_quantization"]
    small = np.zeros((4, 4), "<i2")
    small[:, :3] = np.round(POSITIONS * 32767)
    content["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": 32, "byteStride": 8})
    content["accessors"][0] = {"bufferView": 4, "componentType": 5122, "count": 4, "type": "VEC3", "normalized": True}
    content["nodes"][0]["scale"] = [3, 3, 3]
    np.testing.assert_allclose(_read(tmp_path, content, binary + small.tobytes()).vertices, 3 * POSITIONS, atol=1e-6)


def test_sparse_targets(tmp_path):
    content, binary = document()
    rows, moved = np.array([2, 3], "<u2"), OPEN[2:]
    binary, _ = with_array(content, binary, rows, "SCALAR")
    binary, _ = with_array(content, binary, moved, "VEC3")
    sparse = {"count": 2, "indices": {"bufferView": 4, "componentType": 5123}, "values": {"bufferView": 5}}
    content["accessors"][1] = {"componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse}
    np.testing.assert_allclose(shaped(_read(tmp_path, content, binary), {"jawOpen": 1}), POSITIONS + OPEN, atol=1e-7)


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


@pytest.mark.parametrize(("place", "value", "message"), REPORTED["wrong"])
def test_what_is_wrong_is_said(tmp_path, place, value, message):
    content, binary = document()
    reduce(getitem, place[:-1], content)[place[-1]] = value
    with pytest.raises(InputError, match=message) as refused:
        _read(tmp_path, content, binary)
    assert str(tmp_path) in str(refused.value)


@pytest.mark.parametrize("content", [b"glTF", b"glTF\2\0\0\0\xff\xff\xff\xff" + b"\0" * 20, b"{", b"[]", b"\xff\xfe"])
def test_what_is_no_gltf_is_refused(tmp_path, content):
    (tmp_path / "head.glb").write_bytes(content)
    with pytest.raises(InputError, match=r"head\.glb"):
        gltf_scene.read_gltf(tmp_path / "head.glb")


NAMES = ["jawOpen", "mouthWide"]


def animated(tmp_path: Path, time_s: list[float], values: Any, *how: Any, name: str = "a.glb") -> Path:
    """Write the square of two targets with one animation, of some interpolation and target."""
    return written(tmp_path / name, *gltf.animated_document(time_s, values, *how))


def written(path: Path, content: dict[str, Any], binary: bytes) -> Path:
    path.write_bytes(glb(content, binary))
    return path


@pytest.mark.parametrize("kind", ["LINEAR", "STEP"])
def test_even_keys_are_the_frames(tmp_path: Path, kind: str) -> None:
    """Also where the single precision of a key's time puts it after its frame."""
    rows = np.random.default_rng(2).random((600, 2))
    motion, units = read_motion(animated(tmp_path, [n / 29.97 for n in range(600)], rows, kind))
    assert (motion.rate_hz, len(units), list(motion.names)) == (pytest.approx(30000 / 1001), 0, NAMES)
    assert motion.values == pytest.approx(rows, abs=1e-6)
    assert {channel.unit for channel in motion.channels} == {WEIGHT}


def test_what_is_written_of_a_character_is_read(tmp_path: Path) -> None:
    moved = Motion(np.random.default_rng(3).random((40, 2)), 60.0, tuple(map(Channel, ("jawOpen", "mouthPucker"))))
    write_glb(tmp_path / "a.glb", head(), moved)
    motion, _ = read_motion(tmp_path / "a.glb")
    assert motion.rate_hz == 60
    for name in moved.names:
        assert motion[name] == pytest.approx(moved[name], abs=1e-5)


@pytest.mark.parametrize(
    ("kind", "values", "expected"),
    [
        ("LINEAR", [[0, 1], [1, 0], [0.5, 0]], {0.0: (0, 1), 0.25: (0, 1), 0.75: (0.5, 0.5), 1.5: (0.75, 0)}),
        ("STEP", [[0, 1], [1, 0], [0.5, 0]], {0.0: (0, 1), 0.75: (0, 1), 1.0: (1, 0), 2.0: (0.5, 0)}),
        (
            "CUBICSPLINE",
            [[[0, 0], [0, 1], [2, 0]], [[0, 0], [1, 0], [0, 0]], [[0, 0], [0.5, 0], [0, 0]]],
            {0.5: (0, 1), 0.75: (0.5 + 0.125, 0.5), 1.0: (1, 0), 2.0: (0.5, 0)},
        ),
    ],
)
def test_uneven_keys_are_sampled(tmp_path, kind, values, expected):
    motion, _ = read_motion(animated(tmp_path, [0.5, 1.0, 2.0], values, kind))
    assert motion.rate_hz == 60
    for time_s, row in expected.items():
        assert motion.values[round(60 * time_s)] == pytest.approx(row, abs=1e-6)


def test_expressions_of_a_vrm_animation(tmp_path: Path) -> None:
    rows = [[0, 0, 0], [0.75, 0, 0], [1, 0, 0]]
    target = {"node": 1, "path": "translation"}
    motion, _ = read_motion(animated(tmp_path, [0, 1 / 30, 2 / 30], rows, "LINEAR", target, name="a.vrma"))
    assert (motion.rate_hz, motion.names) == (30, ("eyeBlinkLeft", "eyeBlinkRight"))
    assert motion["eyeBlinkRight"] == pytest.approx([0, 0.75, 1], abs=1e-6)
    assert {".glb", ".gltf", ".vrma"} <= {*formats.list_read_suffixes()}


def test_what_moves_no_face_or_is_damaged_is_refused(tmp_path: Path) -> None:
    cases = {
        r"a\.glb: it has no animation of morph targets or expressions": animated(tmp_path, [0, 1], [[0, 0]] * 2),
        r"b\.glb: the times of an animation do not rise": animated(tmp_path, [0, 0], [[0, 0]] * 2, name="b.glb"),
        r"c\.glb: an array of 2 elements, required 4": animated(tmp_path, [0, 1], [[0, 0]], name="c.glb"),
        r"d\.glb: no glTF document": tmp_path / "d.glb",
    }
    written(tmp_path / "a.glb", *document())
    (tmp_path / "d.glb").write_bytes(b"no")
    for message, file in cases.items():
        with pytest.raises(errors.InputError, match=message):
            read_motion(file)


def test_turns_of_neck_and_head_are_against_their_rest(tmp_path: Path) -> None:
    """The head of a VRM animation whose bones are not along the axes at rest."""
    from scipy.spatial.transform import Rotation

    vowel = [[0, 0, 0], [0.5, 0, 0], [1, 0, 0]]
    content, binary = gltf.animated_document([0, 0.05, 0.1], vowel, target={"node": 1, "path": "translation"})
    rest = [Rotation.from_euler("xyz", angles) for angles in ((0.3, 0.2, -0.1), (-0.2, 0.4, 0.3))]
    neck, head = len(content["nodes"]), len(content["nodes"]) + 1
    for name, turned in zip(("J_Bip_C_Neck", "J_Bip_C_Head"), rest, strict=True):
        content["nodes"].append({"name": name, "rotation": turned.as_quat().tolist()})
    content["nodes"][neck]["children"] = [head]
    content["scenes"][0]["nodes"].append(neck)
    world = (rest[0], rest[0] * rest[1])
    turns = [Rotation.from_rotvec(np.outer(angles, (0, 1, 0))) for angles in ((0, 0.1, 0.2), (0, 0.2, 0.4))]
    animation = content["animations"][1]
    for number, parent, at_rest, turn in zip((neck, head), (Rotation.identity(), world[0]), world, turns, strict=True):
        local = (parent.inv() * turn * at_rest).as_quat().astype("<f4")
        binary, output = with_array(content, binary, local, "VEC4")
        animation["samplers"].append({"input": 4, "output": output})
        target = {"node": number, "path": "rotation"}
        animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": target})
    content["buffers"] = [{"byteLength": len(binary)}]
    motion, _ = read_motion(written(tmp_path / "a.vrma", content, binary))
    assert motion["headYaw"] == pytest.approx([0, 0.3, 0.6], abs=1e-5)
    assert motion.values[:, -2:] == pytest.approx(np.zeros((3, 2)), abs=1e-5)


@pytest.mark.parametrize("pointer", ["/nodes/0/weights", "/meshes/0/weights", "/nodes/0/weights/0"])
def test_pointers_name_weights(tmp_path: Path, pointer: str) -> None:
    rows = np.random.default_rng(4).random((25, 1 if pointer.endswith("0") else 2))
    content, binary = gltf.animated_document([n / 30 for n in range(25)], rows)
    pointed = {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}}
    content["animations"][1]["channels"][0]["target"] = pointed
    motion, _ = read_motion(written(tmp_path / "a.glb", content, binary))
    assert motion.names == tuple(NAMES[: rows.shape[1]])
    assert motion.values == pytest.approx(rows, abs=1e-6)


def test_names_of_targets(tmp_path: Path) -> None:
    """Of the mesh, of a primitive after one without targets, of the arrays; what has none is numbered."""
    content, binary = gltf.animated_document([n / 30 for n in range(5)], [[0, 1]] * 5)
    mesh = content["meshes"][0]
    bare = {"attributes": {"POSITION": 0}, "indices": 3}
    content["accessors"][1]["name"], content["accessors"][2]["name"] = "jawOpen", "mouthPucker"
    for extras, own, expected in (
        ({"targetNames": ["a.001", "b"]}, {}, ("a.001", "b")),
        ({"targetNames": ["a"]}, {}, ("a", "target 1")),
        ({"targetNames": ["a", "a"]}, {}, ("a", "target 1")),
        ({"targetNames": ["Basis", "a", "b"]}, {}, ("a", "b")),
        ({}, {"extras": {"targetNames": ["c", "d"]}}, ("c", "d")),
        ({}, {}, ("jawOpen", "mouthPucker")),
    ):
        content["meshes"][0] = {"primitives": [bare, mesh["primitives"][0] | own], "extras": extras}
        assert read_motion(written(tmp_path / "a.glb", content, binary))[0].names == expected
    content["meshes"][0]["extras"] = {"targetNames": ["a", "b", "c"]}
    with pytest.warns(UserWarning, match="3 names of 2 blendshapes, required as many"):
        read_motion(written(tmp_path / "a.glb", content, binary))


def test_the_animation_that_moves_the_mouth_is_read(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    rows = np.random.default_rng(5).random((5, 2))
    content, binary = gltf.animated_document([n / 30 for n in range(5)], rows)
    talk = content["animations"][1]
    binary, still = with_array(content, binary, np.zeros(10, "<f4"), "SCALAR")
    idle = {"name": "idle", "channels": talk["channels"], "samplers": [{"input": 4, "output": still}]}
    content["animations"] = [idle, talk]
    assert read_motion(written(tmp_path / "a.glb", content, binary))[0].values == pytest.approx(rows, abs=1e-6)
    assert "2 animations move the face: idle, talk; read: talk" in caplog.text


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
    [(gltf_writer.describe_sound("../a b/#1 50%.wav", 0.5), "../a b/#1 50%.wav"),
     ({"audio": {"uri": "ä.wav"}}, "ä.wav"),
     (gltf_writer.describe_sound("a.wav", 2**63), None),
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
    (tmp_path / "original.glb").write_bytes(glb(document, content[28 + size :]))
    return tmp_path / "original.glb"


def test_everything_stays_and_the_animation_comes_first(original: Path, tmp_path: Path) -> None:
    assert gltf_writer.write_animated_gltf(tmp_path / "a.glb", original, weights("jawOpen", "mouthFunnel"), "a.wav")
    before, after = gltf_document.read_gltf_document(original), gltf_document.read_gltf_document(tmp_path / "a.glb")
    for name in ("images", "meshes", "materials", "nodes"):
        assert after.get(name) == before.get(name)
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
    times_s = arrays.read_floats(sampler["input"], 1)[:, 0]
    stored = arrays.read_floats(sampler["output"], 1).reshape(len(times_s), -1)
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


def test_what_is_no_morph_target_and_buffers_elsewhere_are_left_to_another_writer(original, tmp_path):
    content, binary = document()
    content["buffers"][0]["uri"] = data_uri(binary)
    (tmp_path / "elsewhere.gltf").write_text(json.dumps(content))
    for path, moved in ((original, weights("jawOpen", "vowel_aa")), (tmp_path / "elsewhere.gltf", weights("target 0"))):
        assert not gltf_writer.write_animated_gltf(tmp_path / "a.glb", path, moved)
        assert not (tmp_path / "a.glb").exists()
