"""``.livelink.csv``: a take as the app Live Link Face records it, for Unreal and for all that reads such takes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lipmotion.export.base import MotionFormat
from lipmotion.meshes.files.curve_table import read_curve_motion
from lipmotion.types import Generation

CURVES = (
    *("EyeBlinkLeft", "EyeLookDownLeft", "EyeLookInLeft", "EyeLookOutLeft", "EyeLookUpLeft", "EyeSquintLeft"),
    *("EyeWideLeft", "EyeBlinkRight", "EyeLookDownRight", "EyeLookInRight", "EyeLookOutRight", "EyeLookUpRight"),
    *("EyeSquintRight", "EyeWideRight", "JawForward", "JawRight", "JawLeft", "JawOpen", "MouthClose", "MouthFunnel"),
    *("MouthPucker", "MouthRight", "MouthLeft", "MouthSmileLeft", "MouthSmileRight", "MouthFrownLeft"),
    *("MouthFrownRight", "MouthDimpleLeft", "MouthDimpleRight", "MouthStretchLeft", "MouthStretchRight"),
    *("MouthRollLower", "MouthRollUpper", "MouthShrugLower", "MouthShrugUpper", "MouthPressLeft", "MouthPressRight"),
    *("MouthLowerDownLeft", "MouthLowerDownRight", "MouthUpperUpLeft", "MouthUpperUpRight", "BrowDownLeft"),
    *("BrowDownRight", "BrowInnerUp", "BrowOuterUpLeft", "BrowOuterUpRight", "CheekPuff", "CheekSquintLeft"),
    *("CheekSquintRight", "NoseSneerLeft", "NoseSneerRight", "TongueOut", "HeadYaw", "HeadPitch", "HeadRoll"),
    *("LeftEyeYaw", "LeftEyePitch", "LeftEyeRoll", "RightEyeYaw", "RightEyePitch", "RightEyeRoll"),
)
"""The 61 curves in the order of the app's own takes: ARKit's 52 blendshapes, then angles of head and eyes."""
TIMECODE, COUNT = "Timecode", "BlendshapeCount"
TICKS_HZ = 60
"""The frames of a timecode are counted in 60ths of a second at any rate: Unreal's importer divides them by 60."""
DECIMALS = 6


def timecode(time_s: float) -> str:
    """Return a time as the app writes it, ``HH:MM:SS:FF.mmm``, with ``FF.mmm`` in 60ths of a second.

    >>> timecode(3725.025)
    '01:02:05:01.500'
    """
    thousandths = round(time_s * TICKS_HZ * 1000)
    seconds, part = divmod(thousandths, TICKS_HZ * 1000)
    frames, part = divmod(part, 1000)
    return f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}:{frames:02d}.{part:03d}"


def write(path: Path, generation: Generation, _source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write a header and one line a frame; curves that the motion does not have are 0."""
    motion = generation.motion
    table = np.zeros((len(motion.values), len(CURVES)))
    names = {name[:1].upper() + name[1:]: column for column, name in enumerate(motion.names)}
    for column, name in enumerate(CURVES):
        if name in names:
            table[:, column] = motion.values[:, names[name]]
    form = ",".join([f"%.{DECIMALS}f"] * len(CURVES))
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(",".join([TIMECODE, COUNT, *CURVES]) + "\n")
        for time_s, row in zip(motion.time_s.tolist(), table + 0.0, strict=True):
            file.write(f"{timecode(time_s)},{len(CURVES)},{form % tuple(row.tolist())}\n")


MOTION_FORMAT = MotionFormat(write, read_curve_motion, curves="face", rate_hz=float(TICKS_HZ))
