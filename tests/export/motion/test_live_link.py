"""Takes of Live Link Face: the app's own columns, and times as Unreal's importer reads them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lipmotion.export import write_motion
from lipmotion.export.motion.live_link import CURVES, timecode
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, ARKIT_OTHERS
from lipmotion.types import WEIGHT, Channel, Generation, Motion, StateTrace, Timeline

APP = (
    "Timecode,BlendshapeCount,EyeBlinkLeft,EyeLookDownLeft,EyeLookInLeft,EyeLookOutLeft,EyeLookUpLeft,EyeSquintLeft,"
    "EyeWideLeft,EyeBlinkRight,EyeLookDownRight,EyeLookInRight,EyeLookOutRight,EyeLookUpRight,EyeSquintRight,"
    "EyeWideRight,JawForward,JawRight,JawLeft,JawOpen,MouthClose,MouthFunnel,MouthPucker,MouthRight,MouthLeft,"
    "MouthSmileLeft,MouthSmileRight,MouthFrownLeft,MouthFrownRight,MouthDimpleLeft,MouthDimpleRight,"
    "MouthStretchLeft,MouthStretchRight,MouthRollLower,MouthRollUpper,MouthShrugLower,MouthShrugUpper,"
    "MouthPressLeft,MouthPressRight,MouthLowerDownLeft,MouthLowerDownRight,MouthUpperUpLeft,MouthUpperUpRight,"
    "BrowDownLeft,BrowDownRight,BrowInnerUp,BrowOuterUpLeft,BrowOuterUpRight,CheekPuff,CheekSquintLeft,"
    "CheekSquintRight,NoseSneerLeft,NoseSneerRight,TongueOut,HeadYaw,HeadPitch,HeadRoll,LeftEyeYaw,LeftEyePitch,"
    "LeftEyeRoll,RightEyeYaw,RightEyePitch,RightEyeRoll"
)
"""The first line of a take as the app records it."""


def generation(rate_hz: float, count: int = 61) -> Generation:
    rng = np.random.default_rng(1)
    names = (*ARKIT_MOUTH, *ARKIT_OTHERS, "headYaw", "opening")
    moved = Motion(rng.random((count, len(names))), rate_hz, tuple(Channel(name, WEIGHT) for name in names))
    return Generation(moved, np.zeros(moved.values.shape), Timeline(()), StateTrace(("a",), np.zeros(count, np.intp)))


def as_unreal_reads(path: Path) -> tuple[list[str], list[float], np.ndarray]:
    """Return names, times and values by the rules of Unreal's importer (LiveLinkFaceImporterFactory, UE 5)."""
    lines = path.read_text().splitlines()
    keys = lines[0].split(",")
    assert keys[0].lower() == "timecode"
    assert keys[1].lower() == "blendshapecount"
    times, rows = [], []
    for line in lines[1:]:
        fields = line.split(",")
        assert len(fields) == len(keys)
        hours, minutes, seconds, frames = fields[0].split(":")
        times.append(int(hours) * 3600 + int(minutes) * 60 + int(seconds) + float(frames) / 60.0)
        rows.append([float(field) for field in fields[2:]])
    return keys[2:], times, np.array(rows)


def test_the_columns_are_those_of_the_app(tmp_path: Path) -> None:
    write_motion(tmp_path / "a.livelink.csv", generation(60.0), source={}, model={})
    lines = (tmp_path / "a.livelink.csv").read_text().splitlines()
    assert lines[0] == APP
    assert len(CURVES) == 61
    assert all(line.split(",")[1] == "61" and line.count(",") == 62 for line in lines[1:])


@pytest.mark.parametrize("rate_hz", [29.97, 100.0])
def test_unreal_reads_the_same_times_and_values(tmp_path: Path, rate_hz: float) -> None:
    written = generation(rate_hz)
    write_motion(tmp_path / "a.livelink.csv", written, source={}, model={})
    names, times, values = as_unreal_reads(tmp_path / "a.livelink.csv")
    assert times == pytest.approx(written.motion.time_s.tolist(), abs=1e-5)
    for column, name in enumerate(names):
        own = name[0].lower() + name[1:]
        wanted = written.motion[own] if own in written.motion.names else np.zeros(len(times))
        assert values[:, column] == pytest.approx(wanted, abs=1e-6)
    assert "opening" not in (tmp_path / "a.livelink.csv").read_text()


def test_times_carry_over() -> None:
    codes = {0.999999999: "00:00:01:00.000", 1 / 60: "00:00:00:01.000", 59.99: "00:00:59:59.400"}
    codes |= {3600 + 59.5: "01:00:59:30.000", 2 * 3600 + 5 * 60: "02:05:00:00.000"}
    assert {time_s: timecode(time_s) for time_s in codes} == codes
