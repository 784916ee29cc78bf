"""Motions of MikuMikuDance: bytes by the published layout, and as mmd-parser of three.js reads them, where it is."""

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import programs
from formats.examples import of_motion, written
from lipmotion import read_motion
from lipmotion.errors import ExportError, InputError
from lipmotion.formats.vmd import MORPHS
from lipmotion.meshes.fitting.blendshape_motion import with_mouth
from lipmotion.meshes.fitting.eyes_and_brows import gaze_to_weights, weights_to_gaze
from lipmotion.pipeline.outputs.motion_files import check_rate
from lipmotion.types import WEIGHT, Channel, Generation, Motion

FRAMES = 31
NAMES = ("aa", "ih", "ou", "ee", "oh", "closed", "eyeBlinkLeft", "eyeBlinkRight", "headYaw", "headPitch", "headRoll")

BROWS = tuple(Channel(name, WEIGHT) for name in ("browDownLeft", "browDownRight", "a", "b", "c"))


@pytest.fixture
def generation() -> Generation:
    values = np.random.default_rng(5).random((FRAMES, len(NAMES)))
    values[:, 7], values[:, 8:] = values[:, 6], values[:, 8:] - 0.5
    values[5:25, 1] = 0.25
    channels = tuple(Channel(name, "radian" if name.startswith("head") else WEIGHT) for name in NAMES)
    return of_motion(Motion(values, 30.0, channels))


@pytest.fixture
def path(tmp_path: Path, generation: Generation) -> Path:
    return written(tmp_path / "a.vmd", generation)


def test_the_bytes_are_those_of_the_format(path: Path, generation: Generation) -> None:
    content = path.read_bytes()
    assert content[:50] == b"Vocaloid Motion Data 0002".ljust(30, b"\0") + b"lipmotion".ljust(20, b"\0")
    (bones,) = struct.unpack_from("<I", content, 50)
    name, frame, *numbers = struct.unpack_from("<15sI7f", content, 54)
    assert (bones, name.rstrip(b"\0").decode("cp932"), frame, numbers[:3]) == (FRAMES, "頭", 0, [0, 0, 0])
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
    assert generation.motion["aa"][0] == pytest.approx(first)


def test_what_is_written_is_read(path: Path, generation: Generation) -> None:
    motion, units = read_motion(path)
    assert (motion.rate_hz, len(units), set(motion.names)) == (30.0, 0, set(NAMES))
    for name in NAMES:
        assert motion[name] == pytest.approx(generation.motion[name], abs=1e-6)
    assert with_mouth(motion)["lip_gap"].max() > 0.1
    lowered = replace(generation, motion=replace(generation.motion, channels=(*generation.motion.channels[:6], *BROWS)))
    brow = read_motion(written(path, lowered))[0]["browDownLeft"]
    assert brow == pytest.approx(generation.motion["eyeBlinkLeft"], abs=1e-6)


def test_eyes_turn_in_one_bone(tmp_path: Path, generation: Generation) -> None:
    gaze = np.stack([0.3 * np.sin(np.arange(FRAMES)), 0.1 * np.cos(np.arange(FRAMES))], axis=1)
    looks = gaze_to_weights(gaze)
    values = np.concatenate([generation.motion.values, np.stack(list(looks.values()), axis=1)], axis=1)
    channels = (*generation.motion.channels, *(Channel(name, WEIGHT) for name in looks))
    motion, _ = read_motion(written(tmp_path / "a.vmd", of_motion(Motion(values, 30.0, channels))))
    assert weights_to_gaze({name: motion[name].astype(np.float64) for name in looks}) == pytest.approx(gaze, abs=1e-6)
    assert motion["headYaw"] == pytest.approx(generation.motion["headYaw"], abs=1e-6)


def test_the_head_turns_to_its_left_and_up(tmp_path: Path, generation: Generation) -> None:
    """MikuMikuDance's x is to the character's left, y up, z into its face."""
    values = np.zeros((2, len(NAMES)))
    values[1, 8] = 0.3
    path = written(tmp_path / "a.vmd", of_motion(replace(generation.motion, values=values)))
    x, y, z, w = struct.unpack_from("<4f", path.read_bytes(), 54 + 111 + 31)
    face = np.array([-2 * (x * z + w * y), -2 * (y * z - w * x), -(1 - 2 * (x * x + y * y))])  # of (0, 0, -1)
    assert face == pytest.approx([np.sin(0.3), 0, -np.cos(0.3)], abs=1e-6)


def test_held_poses_change_from_one_frame_to_the_next(tmp_path: Path, generation: Generation) -> None:
    values = np.repeat([[0.1] * len(NAMES), [0.6] * len(NAMES)], [10, 21], axis=0)
    held = of_motion(replace(generation.motion, values=values), stepped=NAMES)
    assert read_motion(written(tmp_path / "a.vmd", held))[0]["aa"] == pytest.approx(values[:, 0], abs=1e-6)


def test_it_has_one_rate() -> None:
    check_rate(Path("a.vmd"), 30.0)
    with pytest.raises(ExportError, match=r"a\.vmd: 60 frames a second in \.vmd, required 30: leave --rate out"):
        check_rate(Path("a.vmd"), 60.0)


def _damaged(content: bytes, at: int, new: bytes) -> bytes:
    return content[:at] + new + content[at + len(new) :]


def test_damaged_files_are_refused(path: Path) -> None:
    good = path.read_bytes()
    morphs = 50 + 4 + 111 * FRAMES + 4
    cases = {
        "its first bytes are not those of the format": b"PK" + good[2:],
        "is cut short": good[:-200],
        "a key of '頭' at frame 4294967295 is none": _damaged(good, 54 + 15, b"\xff" * 4),
        "a rotation of the bone 頭 is none": _damaged(good, 54 + 31, bytes(16)),
        "a key of 'あ' at frame 0 is none": _damaged(good, morphs + 19, struct.pack("<f", np.nan)),
        "has none of the morphs あ い う え お; its morphs are: none": good[:50] + bytes(20),
    }
    for message, content in cases.items():
        path.write_bytes(content)
        with pytest.raises(InputError, match=message):
            read_motion(path)


@pytest.mark.long
@pytest.mark.skipif(not programs.node_package("mmd-parser"), reason="no mmd-parser")
def test_three_js_reads_the_same_keys(path: Path, generation: Generation) -> None:
    vmd = programs.run_node("vmd_keys.cjs", "mmd-parser", path)
    assert (vmd["metadata"]["name"], vmd["metadata"]["motionCount"]) == ("lipmotion", FRAMES)
    for morph, sources in MORPHS.items():
        for key in (key for key in vmd["morphs"] if key["morphName"] == morph):
            assert key["weight"] == pytest.approx(generation.motion[sources[0]][key["frameNum"]], abs=1e-6)
    assert {key["boneName"] for key in vmd["motions"]} == {"頭"}
