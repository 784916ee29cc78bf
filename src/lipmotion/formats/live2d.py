"""``.motion3.json``: a motion of Live2D Cubism: how far the mouth is open, and whether it is wide or puckered.

Source: Live2D, Cubism specifications, "motion3.json". Curves are straight lines between keys (segment type 0); keys
that a straight line between others replaces are left out. Held poses change at once (segment type 2).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.lip_points import LEFT_CORNER, RIGHT_CORNER, build_mouth
from lipmotion.articulation.mouth import find_mouth
from lipmotion.errors import ExportError
from lipmotion.formats.base import MotionFormat, list_key_frames
from lipmotion.meshes.fitting.blendshape_motion import arkit_mouth
from lipmotion.storage.json_text import as_json
from lipmotion.types import Generation, Motion

Array = NDArray[np.float64]

OPEN, FORM = "ParamMouthOpenY", "ParamMouthForm"
"""Live2D's standard parameters: 0 closed to 1 open; −1 puckered to 1 wide, as in a smile."""
FULL_GAP = 0.20
"""The gap between the lips that is drawn as wholly open, eye distances."""
LARGEST_WIDENING, LARGEST_NARROWING = 0.08, 0.12
"""By how much the mouth is wider and narrower than at rest where the form is 1 and −1, eye distances."""
FPS = 30.0
"""The frame rate that the file states; its keys are at any time."""
TOLERANCE = 0.005
"""Largest error of a curve through the keys that are kept."""
DECIMALS = 3
LINEAR_SEGMENT, STEPPED_SEGMENT = 0, 2
"""Types of segments: straight to the next key, or held until it."""
SHOWING = frozenset(("opening", "jawOpen"))
"""Channels that say how far the mouth is open."""


def check(motion: Motion) -> None:
    """Raise ExportError if motion shows neither an opening nor an open jaw, or has fewer than two frames."""
    if not SHOWING & set(motion.names) or len(motion.values) < 2:
        raise ExportError("the motion has no channel 'opening' or 'jawOpen', or no two frames; write .json or .csv")


def write(path: Path, generation: Generation, _source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write two curves, and how many keys they have."""
    motion = generation.motion
    curves, points, steps = [], 0, bool(SHOWING & set(generation.stepped))
    for name, values in ((OPEN, measure_mouth_open(generation)), (FORM, measure_mouth_form(generation))):
        rounded = np.round(values, DECIMALS) + 0.0
        frames = list_key_frames(motion.time_s, rounded, TOLERANCE, stepped=steps)
        keys = [(round(float(motion.time_s[frame]), 6), float(rounded[frame])) for frame in frames]
        segments: list[float] = [*keys[0]]
        for time_s, value in keys[1:]:
            segments += [STEPPED_SEGMENT if steps else LINEAR_SEGMENT, time_s, value]
        curves.append({"Target": "Parameter", "Id": name, "Segments": segments})
        points += len(keys)
    meta = {
        **{"Duration": round(float(motion.time_s[-1]), 6), "Fps": FPS, "Loop": False, "AreBeziersRestricted": True},
        **{"CurveCount": len(curves), "TotalSegmentCount": points - len(curves), "TotalPointCount": points},
        **{"UserDataCount": 0, "TotalUserDataSize": 0},
    }
    path.write_text(as_json({"Version": 3, "Meta": meta, "Curves": curves}) + "\n", encoding="utf-8")


def measure_mouth_open(generation: Generation) -> Array:
    """Return how far the mouth is open, 0 to 1 [shape=(T,)]; 0 where the lips touch."""
    motion = generation.motion
    if "opening" in motion.names:
        gap = find_mouth(motion, generation.units).gap
    else:
        gap = _sum_effects(motion, arkit_mouth().gap)
    return np.clip(gap / FULL_GAP, 0.0, 1.0)


def measure_mouth_form(generation: Generation) -> Array:
    """Return the form of the mouth, −1 puckered to 1 wide [shape=(T,)]; 0 at rest, and where no channel says it."""
    motion = generation.motion
    if "opening" in motion.names and "width" in motion.names:
        wider = (find_mouth(motion, generation.units).width - 1) * build_mouth().width
    else:
        template = build_mouth()
        corners = arkit_mouth().moved[:, [template.row(LEFT_CORNER), template.row(RIGHT_CORNER)], 0]
        wider = _sum_effects(motion, corners[:, 0] - corners[:, 1])
    return np.clip(wider / np.where(wider > 0, LARGEST_WIDENING, LARGEST_NARROWING), -1.0, 1.0)


def _sum_effects(motion: Motion, effects: Array) -> Array:
    """Return the sum of the effects of blendshapes by their weights [shape=(T,)]."""
    total = np.zeros(len(motion.values))
    for name, effect in zip(arkit_mouth().known, effects, strict=True):
        if name in motion.names:
            total += effect * motion[name]
    return total


MOTION_FORMAT = MotionFormat(write, check=check, mouth=True)
