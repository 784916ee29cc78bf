"""Motions of MikuMikuDance: bytes by the published layout, and as mmd-parser of three.js reads them, where it is."""

import json
import os
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import programs
from children import run_child
from formats.examples import generation, of_motion, written
from formats.examples import written as write
from lipmotion import read_motion
from lipmotion import write as write_outputs
from lipmotion.articulation.lip_points import build_mouth
from lipmotion.errors import ExportError, InputError
from lipmotion.formats.c3d import CENTIMETRES
from lipmotion.formats.game_engines import TOLERANCE, measure_mouth_form, measure_mouth_open
from lipmotion.formats.vmd import MORPHS
from lipmotion.meshes.fitting.blendshape_motion import move_points, with_mouth
from lipmotion.meshes.fitting.eyes_and_brows import gaze_to_weights, weights_to_gaze
from lipmotion.meshes.model.mesh import ANGLES, turn_head
from lipmotion.types import WEIGHT, Channel, Generation, Motion, Span, Timeline, Unit
from lipmotion_faces.characters.gltf_document import read_gltf_document

BVH_FRAMES = 60
BLENDER = os.environ.get("LIPMOTION_BPY_PYTHON", "")  # a Python that has the package ``bpy``
IN_BLENDER = """
import bpy, json, sys
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_anim.bvh(filepath=sys.argv[1], axis_forward="Y", axis_up="Z", use_fps_scale=False, global_scale=1.0,
                        update_scene_fps=True, update_scene_duration=True)
armature, scene = bpy.context.object, bpy.context.scene
found = {"fps": scene.render.fps / scene.render.fps_base, "frames": {}}
found["bones"] = [bone.name for bone in armature.pose.bones]
for frame in (1, 20, 60):
    scene.frame_set(frame)
    found["frames"][frame] = {bone.name: list(bone.matrix.to_translation()) for bone in armature.pose.bones}
print("FOUND" + json.dumps(found))
"""


@pytest.fixture
def talking_bvh() -> Generation:
    time_s = np.arange(BVH_FRAMES) / 50
    opening = 0.01 + 0.15 * (time_s > 0.3) * np.sin(2 * np.pi * 2 * time_s) ** 2
    width = 0.6 + 0.03 * np.sin(2 * np.pi * time_s)
    motion = Motion(np.stack([opening, width], axis=1), 50.0, (Channel("opening"), Channel("width")))
    return of_motion(motion, Timeline((Span(0.0, 0.3, Unit("sil")), Span(0.3, 1.2, Unit("aa")))))


@pytest.fixture
def written_bvh(talking_bvh: Generation, tmp_path: Path) -> Path:
    return write(tmp_path / "a.bvh", talking_bvh)


def expected(talking_bvh: Generation) -> np.ndarray:
    """Return the places of the points in centimetres [shape=(T, 52, 3)]."""
    moved = move_points(talking_bvh.motion, talking_bvh.units).displacements
    return (build_mouth().places + moved) * CENTIMETRES


def test_hierarchy_and_motion(talking_bvh, written_bvh):
    lines = written_bvh.read_text().splitlines()
    names = [line.split()[1] for line in lines if line.strip().startswith(("ROOT", "JOINT"))]
    assert names == ["head", *(f"{'JAW' if j else 'LIP'}_{p}" for p, j in zip(*_points(), strict=True))]
    assert lines.count("{") + sum(line.strip() == "{" and line != "{" for line in lines) == 1 + 2 * 52
    channels = sum(int(line.split()[1]) for line in lines if line.strip().startswith("CHANNELS"))
    at = lines.index("MOTION")
    assert lines[at + 1 : at + 3] == [f"Frames: {BVH_FRAMES}", "Frame Time: 0.020000000"]
    rows = np.array([list(map(float, line.split())) for line in lines[at + 3 :]])
    assert rows.shape == (BVH_FRAMES, channels)
    assert not rows[:, :6].any()
    np.testing.assert_allclose(rows[:, 6:].reshape(BVH_FRAMES, 52, 3), expected(talking_bvh), atol=5.1e-6)


def _points():
    template = build_mouth()
    return template.points, template.jaw


@pytest.mark.long
@pytest.mark.skipif(not BLENDER, reason="LIPMOTION_BPY_PYTHON names no Python with the package bpy")
def test_blender_shows_the_same_places(talking_bvh, written_bvh, tmp_path):
    """Oracle: the importer of Blender."""
    (tmp_path / "look.py").write_text(IN_BLENDER)
    done = run_child([BLENDER, tmp_path / "look.py", written_bvh], check=True)
    found = json.loads(done.stdout.partition("FOUND")[2].splitlines()[0])
    assert found["fps"] == pytest.approx(50.0)
    assert len(found["bones"]) == 53
    places = expected(talking_bvh)
    for frame, bones in found["frames"].items():
        for number, (point, jaw) in enumerate(zip(*_points(), strict=True)):
            x, y, z = bones[f"{'JAW' if jaw else 'LIP'}_{point}"]
            np.testing.assert_allclose([x, y, z], places[int(frame) - 1, number], atol=1e-4)


def test_what_cannot_be_placed_is_refused(tmp_path, talking_bvh):
    other = Motion(np.zeros((3, 1)), 50.0, (Channel("jawOpen", "weight"),))
    with pytest.raises(ExportError, match="3 frames of jawOpen, required 1 or more of opening"):
        write(tmp_path / "a.bvh", of_motion(other, talking_bvh.units))


VMD_FRAMES = 31
NAMES = ("aa", "ih", "ou", "ee", "oh", "closed", "eyeBlinkLeft", "eyeBlinkRight", *ANGLES)
BROWS = tuple(Channel(name, WEIGHT) for name in ("browDownLeft", "browDownRight", "a", "b", "c"))


@pytest.fixture
def vmd_generation() -> Generation:
    made = generation(*NAMES, frames=VMD_FRAMES)
    made.motion.values[:, 7] = made.motion.values[:, 6]
    made.motion.values[5:25, 1] = 0.3
    return made


@pytest.fixture
def vmd_path(tmp_path: Path, vmd_generation: Generation) -> Path:
    return written(tmp_path / "a.vmd", vmd_generation)


def test_the_bytes_are_those_of_the_format(vmd_path: Path, vmd_generation: Generation) -> None:
    content = vmd_path.read_bytes()
    assert content[:50] == b"Vocaloid Motion Data 0002".ljust(30, b"\0") + b"lipmotion".ljust(20, b"\0")
    (bones,) = struct.unpack_from("<I", content, 50)
    name, frame, *numbers = struct.unpack_from("<15sI7f", content, 54)
    assert (bones, name.rstrip(b"\0").decode("cp932"), frame, numbers[:3]) == (VMD_FRAMES, "頭", 0, [0, 0, 0])
    assert sum(number**2 for number in numbers[3:]) == pytest.approx(1, abs=1e-6)
    at = 54 + 111 * bones
    (morphs,) = struct.unpack_from("<I", content, at)
    assert len(content) == at + 4 + 23 * morphs + 16
    keys = [struct.unpack_from("<15sIf", content, at + 4 + 23 * n) for n in range(morphs)]
    assert {name.rstrip(b"\0").decode("cp932") for name, _, _ in keys} == set("あいうえおん") | {"まばたき"}
    assert [frame for _, frame, _ in keys] == sorted(frame for _, frame, _ in keys)
    held = [frame for name, frame, _ in keys if name.startswith("い".encode("cp932")) and 5 <= frame < 25]
    assert held == [5, 24]
    first = next(weight for name, _, weight in keys if name.startswith("あ".encode("cp932")))
    assert vmd_generation.motion["aa"][0] == pytest.approx(first)


def test_what_is_written_is_read(vmd_path: Path, vmd_generation: Generation) -> None:
    motion, units = read_motion(vmd_path)
    assert (motion.rate_hz, len(units), set(motion.names)) == (30.0, 0, set(NAMES))
    for name in NAMES:
        assert motion[name] == pytest.approx(vmd_generation.motion[name], abs=1e-6)
    assert with_mouth(motion)["lip_gap"].max() > 0.1
    moved = vmd_generation.motion
    lowered = replace(vmd_generation, motion=replace(moved, channels=(*moved.channels[:6], *BROWS)))
    brow = read_motion(written(vmd_path, lowered))[0]["browDownLeft"]
    assert brow == pytest.approx(vmd_generation.motion["eyeBlinkLeft"], abs=1e-6)


def test_eyes_turn_in_one_bone(tmp_path: Path, vmd_generation: Generation) -> None:
    gaze = np.stack([0.3 * np.sin(np.arange(VMD_FRAMES)), 0.1 * np.cos(np.arange(VMD_FRAMES))], axis=1)
    looks = gaze_to_weights(gaze)
    values = np.concatenate([vmd_generation.motion.values, np.stack(list(looks.values()), axis=1)], axis=1)
    channels = (*vmd_generation.motion.channels, *(Channel(name, WEIGHT) for name in looks))
    motion, _ = read_motion(written(tmp_path / "a.vmd", of_motion(Motion(values, 30.0, channels))))
    assert weights_to_gaze({name: motion[name].astype(np.float64) for name in looks}) == pytest.approx(gaze, abs=1e-6)
    assert motion["headYaw"] == pytest.approx(vmd_generation.motion["headYaw"], abs=1e-6)


def test_the_head_turns_to_its_left_and_up(tmp_path: Path, vmd_generation: Generation) -> None:
    """MikuMikuDance's x is to the character's left, y up, z into its face."""
    values = np.zeros((2, len(NAMES)))
    values[1, 8] = 0.3
    vmd_path = written(tmp_path / "a.vmd", of_motion(replace(vmd_generation.motion, values=values)))
    x, y, z, w = struct.unpack_from("<4f", vmd_path.read_bytes(), 54 + 111 + 31)
    face = np.array([-2 * (x * z + w * y), -2 * (y * z - w * x), -(1 - 2 * (x * x + y * y))])  # of (0, 0, -1)
    assert face == pytest.approx([np.sin(0.3), 0, -np.cos(0.3)], abs=1e-6)


def test_held_poses_change_from_one_frame_to_the_next(tmp_path: Path, vmd_generation: Generation) -> None:
    values = np.repeat([[0.1] * len(NAMES), [0.6] * len(NAMES)], [10, 21], axis=0)
    held = of_motion(replace(vmd_generation.motion, values=values), stepped=NAMES)
    assert read_motion(written(tmp_path / "a.vmd", held))[0]["aa"] == pytest.approx(values[:, 0], abs=1e-6)


def test_it_has_one_rate(tmp_path: Path, vmd_generation: Generation) -> None:
    write_outputs(vmd_generation, tmp_path / "a.vmd", rate_hz=30)
    with pytest.raises(ExportError, match=r"a\.vmd: 60 frames a second in \.vmd, required 30: leave --rate out"):
        write_outputs(vmd_generation, tmp_path / "a.vmd", rate_hz=60)


def _damaged(content: bytes, at: int, new: bytes) -> bytes:
    return content[:at] + new + content[at + len(new) :]


def test_damaged_files_are_refused(vmd_path: Path) -> None:
    good = vmd_path.read_bytes()
    morphs = 50 + 4 + 111 * VMD_FRAMES + 4
    for message, content in {
        "its first bytes are not those of the format": b"PK" + good[2:],
        "is cut short": good[:-200],
        "a key of '頭' at frame 4294967295 is none": _damaged(good, 54 + 15, b"\xff" * 4),
        "a rotation of the bone 頭 is none": _damaged(good, 54 + 31, bytes(16)),
        "a key of 'あ' at frame 0 is none": _damaged(good, morphs + 19, struct.pack("<f", np.nan)),
        "has none of the morphs あ い う え お; its morphs are: none": good[:50] + bytes(20),
    }.items():
        vmd_path.write_bytes(content)
        with pytest.raises(InputError, match=message):
            read_motion(vmd_path)


@pytest.mark.long
@pytest.mark.skipif(not programs.node_package("mmd-parser"), reason="no mmd-parser")
def test_three_js_reads_the_same_keys(vmd_path: Path, vmd_generation: Generation) -> None:
    vmd = programs.run_node("vmd_keys.cjs", "mmd-parser", vmd_path)
    assert (vmd["metadata"]["name"], vmd["metadata"]["motionCount"]) == ("lipmotion", VMD_FRAMES)
    for morph, sources in MORPHS.items():
        for key in (key for key in vmd["morphs"] if key["morphName"] == morph):
            assert key["weight"] == pytest.approx(vmd_generation.motion[sources[0]][key["frameNum"]], abs=1e-6)
    assert {key["boneName"] for key in vmd["motions"]} == {"頭"}


FRAMES = 300


@pytest.fixture
def talking_live2d() -> Generation:
    """Lips that open and close from second 1 on, wider and narrower in turn."""
    time_s = np.arange(FRAMES) / 100
    speaking = time_s >= 1
    opening = 0.01 + 0.15 * speaking * np.sin(2 * np.pi * 2 * time_s) ** 2
    width = 0.6 + 0.08 * speaking * np.sin(2 * np.pi * time_s)
    motion = Motion(np.stack([opening, width], axis=1), 100.0, (Channel("opening"), Channel("width")))
    return of_motion(motion, Timeline((Span(0.0, 1.0, Unit("sil")), Span(1.0, 3.0, Unit("aa")))))


def read(path: Path) -> tuple[dict, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """Read as Cubism does: a first point, then segments that begin with their type and hold 1, 3, 1 or 1 points."""
    document = json.loads(path.read_text(encoding="utf-8"))
    points_of = {0: 1, 1: 3, 2: 1, 3: 1}
    curves, segments, points = {}, 0, 0
    for curve in document["Curves"]:
        numbers, at = curve["Segments"], 2
        keys = [(numbers[0], numbers[1])]
        while at < len(numbers):
            count = points_of[numbers[at]]
            keys += [(numbers[at + 1], numbers[at + 2])]
            at += 1 + 2 * count
            segments, points = segments + 1, points + count
        assert at == len(numbers)
        points += 1
        times_s, values = zip(*keys, strict=True)
        curves[curve["Id"]] = (np.array(times_s), np.array(values))
        assert curve["Target"] == "Parameter"
    meta = document["Meta"]
    assert document["Version"] == 3
    assert (meta["CurveCount"], meta["TotalSegmentCount"], meta["TotalPointCount"]) == (len(curves), segments, points)
    assert (meta["UserDataCount"], meta["TotalUserDataSize"]) == (0, 0)
    assert set(meta) >= {"Duration", "Fps", "Loop", "AreBeziersRestricted"}
    return meta, curves


def test_curves_through_the_keys_are_those_of_the_mouth(tmp_path, talking_live2d):
    meta, curves = read(written(tmp_path / "a.motion3.json", talking_live2d))
    assert meta["Duration"] == pytest.approx(2.99)
    for name, values in (
        ("ParamMouthOpenY", measure_mouth_open(talking_live2d)),
        ("ParamMouthForm", measure_mouth_form(talking_live2d)),
    ):
        times_s, keys = curves[name]
        assert times_s[0] == 0
        assert times_s[-1] == pytest.approx(2.99)
        assert np.diff(times_s).min() > 0
        assert len(keys) < 0.6 * FRAMES
        assert np.abs(np.interp(talking_live2d.motion.time_s, times_s, keys) - values).max() <= TOLERANCE + 5.1e-4


def test_held_poses_change_at_once(tmp_path, talking_live2d):
    values = np.repeat([[0.01, 0.6], [0.16, 0.6], [0.01, 0.65]], 100, axis=0)
    steps = replace(talking_live2d, motion=replace(talking_live2d.motion, values=values), stepped=("opening", "width"))
    both = enumerate((steps, replace(steps, stepped=())))
    paths = [written(tmp_path / f"{number}.motion3.json", each) for number, each in both]
    assert read(paths[0])[1]["ParamMouthOpenY"][0].tolist() == [0, 1, 2, 2.99]
    held, smooth = (json.loads(path.read_text())["Curves"][0]["Segments"][2::3] for path in paths)
    assert (held, set(smooth)) == ([2, 2, 2], {0})


def test_the_mouth_rests_opens_and_is_wide(talking_live2d):
    opened, form = measure_mouth_open(talking_live2d), measure_mouth_form(talking_live2d)
    assert opened[:100].max() < 1e-9
    assert 0.75 < opened.max() < 0.95
    assert np.abs(form[:100]).max() < 1e-9
    assert form.max() > 0.9
    assert -0.7 < form.min() < -0.6


def test_blendshapes_open_it_as_well(tmp_path, talking_live2d):
    weights = np.zeros((FRAMES, 3))
    weights[100:, 0], weights[150:, 1], weights[200:, 2] = 0.5, 0.5, 0.8
    names = ("jawOpen", "mouthClose", "mouthPucker")
    motion = Motion(weights, 60.0, tuple(Channel(name, WEIGHT) for name in names))
    moved = replace(talking_live2d, motion=motion, spread=weights)
    opened, form = measure_mouth_open(moved), measure_mouth_form(moved)
    assert opened[:100].max() < 1e-9
    assert opened[100:150].min() > 0.3
    assert opened[150:200].max() < 0.05
    assert form[200:].max() < -0.3
    assert read(written(tmp_path / "a.motion3.json", moved))[0]["CurveCount"] == 2


def test_what_does_not_open_is_refused(tmp_path, talking_live2d):
    still = replace(talking_live2d, motion=Motion(np.zeros((5, 1)), 100.0, (Channel("brow", WEIGHT),)))
    with pytest.raises(ExportError, match="required 2 or more of opening or jawOpen"):
        written(tmp_path / "a.motion3.json", still)
    assert not list(tmp_path.iterdir())


@pytest.fixture
def talking_vrm() -> Generation:
    return generation(*NAMES)


@pytest.fixture
def path(talking_vrm: Generation, tmp_path: Path) -> Path:
    return written(tmp_path / "a.vrma", talking_vrm, path="a.wav")


def test_what_is_written_is_read_with_moods_where_there_are_some(path, talking_vrm, tmp_path):
    motion, _ = read_motion(path)
    assert motion.rate_hz == 30
    for name in ("aa", "oh", "eyeBlinkLeft", "eyeBlinkRight", *ANGLES):
        assert motion[name] == pytest.approx(talking_vrm.motion[name], abs=1e-6)
    happy = generation("aa", "happy")
    read = read_motion(written(tmp_path / "b.vrma", happy))[0]
    assert read["mood_happy"] == pytest.approx(happy.motion["happy"], abs=1e-6)
    with pytest.raises(ExportError, match="required 2 or more of aa or ih or ou or ee or oh"):
        written(tmp_path / "c.vrma", generation("jawOpen"))


def test_the_extension_is_as_its_rules_say(path: Path) -> None:
    json = read_gltf_document(path).json
    extension = json["extensions"]["VRMC_vrm_animation"]
    assert (json["extensionsUsed"], extension["specVersion"]) == (["VRMC_vrm_animation"], "1.0")
    assert [*extension["expressions"]["preset"]] == ["aa", "ih", "ou", "ee", "oh", "blinkLeft", "blinkRight"]
    assert {"hips", "spine", "head"} == {*extension["humanoid"]["humanBones"]}
    assert json["scenes"][0]["extras"] == {"audio": {"uri": "a.wav", "start_s": 0.0}}
    used = [channel["target"]["node"] for channel in json["animations"][0]["channels"]]
    assert len(used) == len({*used})


def test_equal_blinks_are_one_and_held_poses_jump(tmp_path: Path, talking_vrm: Generation) -> None:
    values = talking_vrm.motion.values.copy()
    values[:, 7] = values[:, 6]
    path = written(tmp_path / "a.vrma", replace(talking_vrm, motion=replace(talking_vrm.motion, values=values)))
    preset = read_gltf_document(path).json["extensions"]["VRMC_vrm_animation"]["expressions"]["preset"]
    assert "blink" in preset
    assert "blinkLeft" not in preset
    motion, _ = read_motion(written(tmp_path / "b.vrma", generation("aa", stepped=("aa",))))
    assert motion.at(np.array([19 / 60, 20.1 / 60]))[:, 0] == pytest.approx([0.25, 0.75], abs=1e-4)


@pytest.mark.long
@pytest.mark.skipif(not programs.node_package("@pixiv/three-vrm-animation"), reason="no three-vrm-animation")
def test_three_vrm_reads_it(path: Path, talking_vrm: Generation) -> None:
    found = programs.run_node("vrm_animation.mjs", "@pixiv/three-vrm-animation", path)
    assert (found["warnings"], found["custom"], found["hips"]) == ([], {}, [0, 1, 0])
    for name in ("aa", "ih", "ou", "ee", "oh"):
        track = found["expressions"][name]
        assert track["times"] == pytest.approx(talking_vrm.motion.time_s, abs=1e-6)
        assert track["values"] == pytest.approx(talking_vrm.motion[name], abs=1e-6)
    turned = turn_head(np.stack([talking_vrm.motion[name] for name in ANGLES], axis=1))
    assert found["rotations"]["head"]["values"] == pytest.approx(turned.reshape(-1), abs=1e-6)


@pytest.mark.long
@pytest.mark.skipif(programs.gltf_validator() is None, reason="no gltf-validator")
def test_the_validator_finds_no_error_and_no_warning(path: Path) -> None:
    report = programs.gltf_report(path)
    assert (report["numErrors"], report["numWarnings"]) == (0, 0)
