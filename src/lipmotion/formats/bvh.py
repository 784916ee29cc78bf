"""``.bvh``: lip and jaw points as joints that shift, for programs that know motion capture of bodies.

Centimetres, y up, z out of the face: an eye distance is ``CENTIMETRES``. Every point is a joint ``LIP_13`` or
``JAW_152`` under the joint ``head``, with three channels of its place; offsets are the rest pose. Not read back.
Source: Biovision's format, as described in M. Meredith and S. Maddock, "Motion Capture File Formats Explained", 2001.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.lip_points import build_mouth
from lipmotion.errors import ExportError
from lipmotion.formats.base import MotionFormat, format_rows
from lipmotion.meshes.fitting.blendshape_motion import move_points
from lipmotion.types import Generation, Motion

Array = NDArray[np.float64]

CENTIMETRES = 9.0
ROOT_CHANNELS = "Xposition Yposition Zposition Zrotation Xrotation Yrotation"
POINT_CHANNELS = "Xposition Yposition Zposition"


def check(motion: Motion) -> None:
    """Raise ExportError if motion has no opening, or no frames."""
    if "opening" not in motion.names or not len(motion.values):
        raise ExportError(
            "the motion has no channel 'opening' to place lip points by, or no frames; write .json or .csv"
        )


def write(path: Path, generation: Generation, _source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write the points; of motion with distances alone, they move as mouths do (``fitting.blendshape_motion``)."""
    motion, template = generation.motion, build_mouth()
    moved = move_points(motion, generation.units).expressed
    offsets = [" ".join(f"{value:.5f}" for value in place * CENTIMETRES) for place in template.places]
    lines = ["HIERARCHY", "ROOT head", "{", "  OFFSET 0 0 0", f"  CHANNELS 6 {ROOT_CHANNELS}"]
    for point, jaw, offset in zip(template.points, template.jaw, offsets, strict=True):
        lines += [f"  JOINT {'JAW' if jaw else 'LIP'}_{point}", "  {", f"    OFFSET {offset}"]
        lines += [f"    CHANNELS 3 {POINT_CHANNELS}", "    End Site", "    {", "      OFFSET 0 0 0.5", "    }", "  }"]
    lines += ["}", "MOTION", f"Frames: {len(motion.values)}", f"Frame Time: {1 / motion.rate_hz:.9f}"]
    places = ((template.places + moved) * CENTIMETRES).reshape(len(moved), -1)
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("\n".join(lines) + "\n")
        for row in format_rows(places):
            file.write(f"0 0 0 0 0 0 {row.replace(',', ' ')}\n")


MOTION_FORMAT = MotionFormat(write, check=check, mouth=True)
