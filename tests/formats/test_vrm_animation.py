"""VRM animations: read back, and by three-vrm and Khronos' validator, where they are."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import programs
from formats.examples import generation, written
from lipmotion import read_motion
from lipmotion.errors import ExportError
from lipmotion.meshes.model.mesh import ANGLES, head_quaternions
from lipmotion.types import Generation
from lipmotion_faces.characters.gltf_document import read_gltf_document

NAMES = ("aa", "ih", "ou", "ee", "oh", "closed", "eyeBlinkLeft", "eyeBlinkRight", *ANGLES)


@pytest.fixture
def talking() -> Generation:
    return generation(*NAMES)


@pytest.fixture
def path(talking: Generation, tmp_path: Path) -> Path:
    return written(tmp_path / "a.vrma", talking, path="a.wav")


def test_what_is_written_is_read_with_moods_where_there_are_some(
    path: Path, talking: Generation, tmp_path: Path
) -> None:
    motion, _ = read_motion(path)
    assert motion.rate_hz == 30
    for name in ("aa", "oh", "eyeBlinkLeft", "eyeBlinkRight", *ANGLES):
        assert motion[name] == pytest.approx(talking.motion[name], abs=1e-6)
    happy = generation("aa", "happy")
    read = read_motion(written(tmp_path / "b.vrma", happy))[0]
    assert read["mood_happy"] == pytest.approx(happy.motion["happy"], abs=1e-6)
    with pytest.raises(ExportError, match="none of the vowels aa ih ou ee oh"):
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


def test_equal_blinks_are_one_and_held_poses_jump(tmp_path: Path, talking: Generation) -> None:
    values = talking.motion.values.copy()
    values[:, 7] = values[:, 6]
    path = written(tmp_path / "a.vrma", replace(talking, motion=replace(talking.motion, values=values)))
    preset = read_gltf_document(path).json["extensions"]["VRMC_vrm_animation"]["expressions"]["preset"]
    assert "blink" in preset
    assert "blinkLeft" not in preset
    motion, _ = read_motion(written(tmp_path / "b.vrma", generation("aa", stepped=("aa",))))
    assert motion.at(np.array([19 / 60, 20.1 / 60]))[:, 0] == pytest.approx([0.25, 0.75], abs=1e-4)


@pytest.mark.long
@pytest.mark.skipif(not programs.node_package("@pixiv/three-vrm-animation"), reason="no three-vrm-animation")
def test_three_vrm_reads_it(path: Path, talking: Generation) -> None:
    found = programs.run_node("vrm_animation.mjs", "@pixiv/three-vrm-animation", path)
    assert (found["warnings"], found["custom"], found["hips"]) == ([], {}, [0, 1, 0])
    for name in ("aa", "ih", "ou", "ee", "oh"):
        track = found["expressions"][name]
        assert track["times"] == pytest.approx(talking.motion.time_s, abs=1e-6)
        assert track["values"] == pytest.approx(talking.motion[name], abs=1e-6)
    turned = head_quaternions(np.stack([talking.motion[name] for name in ANGLES], axis=1))
    assert found["rotations"]["head"]["values"] == pytest.approx(turned.reshape(-1), abs=1e-6)


@pytest.mark.long
@pytest.mark.skipif(programs.gltf_validator() is None, reason="no gltf-validator")
def test_the_validator_finds_no_error_and_no_warning(path: Path) -> None:
    report = programs.gltf_report(path)
    assert (report["numErrors"], report["numWarnings"]) == (0, 0)
