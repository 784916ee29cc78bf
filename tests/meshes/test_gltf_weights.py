from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion import errors, formats, read_motion
from lipmotion.types import WEIGHT, Channel, Motion
from meshes import gltf
from meshes.heads import head, write_glb

NAMES = ["jawOpen", "mouthWide"]


def animated(tmp_path: Path, time_s: list[float], values: Any, *how: Any, name: str = "a.glb") -> Path:
    """Write the square of two targets with one animation, of some interpolation and target."""
    (tmp_path / name).write_bytes(gltf.glb(*gltf.animated_document(time_s, values, *how)))
    return tmp_path / name


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
def test_uneven_keys_are_sampled(
    tmp_path: Path, kind: str, values: Any, expected: dict[float, tuple[float, float]]
) -> None:
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
    assert {".glb", ".gltf", ".vrma"} <= {*formats.readable_suffixes()}


def test_what_moves_no_face_or_is_damaged_is_refused(tmp_path: Path) -> None:
    cases = {
        r"a\.glb: it has no animation of morph targets or expressions": animated(tmp_path, [0, 1], [[0, 0]] * 2),
        r"b\.glb: the times of an animation do not rise": animated(tmp_path, [0, 0], [[0, 0]] * 2, name="b.glb"),
        r"c\.glb: an array of 2 elements, required 4": animated(tmp_path, [0, 1], [[0, 0]], name="c.glb"),
        r"d\.glb: no glTF document": tmp_path / "d.glb",
    }
    content, binary = gltf.document()
    (tmp_path / "a.glb").write_bytes(gltf.glb(content, binary))
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
        binary, output = gltf.with_array(content, binary, local, "VEC4")
        animation["samplers"].append({"input": 4, "output": output})
        target = {"node": number, "path": "rotation"}
        animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": target})
    content["buffers"] = [{"byteLength": len(binary)}]
    (tmp_path / "a.vrma").write_bytes(gltf.glb(content, binary))
    motion, _ = read_motion(tmp_path / "a.vrma")
    assert motion["headYaw"] == pytest.approx([0, 0.3, 0.6], abs=1e-5)
    assert motion.values[:, -2:] == pytest.approx(np.zeros((3, 2)), abs=1e-5)


@pytest.mark.parametrize("pointer", ["/nodes/0/weights", "/meshes/0/weights", "/nodes/0/weights/0"])
def test_pointers_name_weights(tmp_path: Path, pointer: str) -> None:
    rows = np.random.default_rng(4).random((25, 1 if pointer.endswith("0") else 2))
    content, binary = gltf.animated_document([n / 30 for n in range(25)], rows)
    pointed = {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}}
    content["animations"][1]["channels"][0]["target"] = pointed
    (tmp_path / "a.glb").write_bytes(gltf.glb(content, binary))
    motion, _ = read_motion(tmp_path / "a.glb")
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
        ({}, {"extras": {"targetNames": ["c", "d"]}}, ("c", "d")),
        ({}, {}, ("jawOpen", "mouthPucker")),
    ):
        content["meshes"][0] = {"primitives": [bare, mesh["primitives"][0] | own], "extras": extras}
        (tmp_path / "a.glb").write_bytes(gltf.glb(content, binary))
        assert read_motion(tmp_path / "a.glb")[0].names == expected


def test_the_animation_that_moves_the_mouth_is_read(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    rows = np.random.default_rng(5).random((5, 2))
    content, binary = gltf.animated_document([n / 30 for n in range(5)], rows)
    talk = content["animations"][1]
    binary, still = gltf.with_array(content, binary, np.zeros(10, "<f4"), "SCALAR")
    idle = {"name": "idle", "channels": talk["channels"], "samplers": [{"input": 4, "output": still}]}
    content["animations"] = [idle, talk]
    (tmp_path / "a.glb").write_bytes(gltf.glb(content, binary))
    assert read_motion(tmp_path / "a.glb")[0].values == pytest.approx(rows, abs=1e-6)
    assert "2 animations move the face: idle, talk; read: talk" in caplog.text
