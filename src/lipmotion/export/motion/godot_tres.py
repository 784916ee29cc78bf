"""``.tres``: an Animation of Godot 4 that moves the blend shapes of the root node of its AnimationPlayer.

Source: Godot 4, Animation (``TYPE_BLEND_SHAPE``), scene/resources/animation.cpp: keys are time, transition and value,
one after another. Between keys everything is linear; keys that a straight line between others replaces are left out,
and held poses change at once (``interp`` 0).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lipmotion.errors import ExportError
from lipmotion.export.base import MotionFormat
from lipmotion.export.motion.keys import key_frames
from lipmotion.types import WEIGHT, Generation, Motion

TOLERANCE = 1e-4
"""Largest error of a curve through the keys that are kept."""
DECIMALS = 5
NEAREST, LINEAR = 0, 1
"""Ways between keys."""
NODE = "."
"""The node whose blend shapes move: the root node of the AnimationPlayer itself."""
FORBIDDEN = frozenset('".:@/%')
"""Characters that no name in a path of Godot has."""


def check(motion: Motion) -> None:
    """Raise ExportError if motion has no weights, or a name that no path of Godot can have."""
    names = [channel.name for channel in motion.channels if channel.unit == WEIGHT]
    if not names or not len(motion.values):
        raise ExportError("the motion has no blendshapes, or no frames; write .json or .csv")
    for name in names:
        if FORBIDDEN & {*name}:
            raise ExportError(
                f'the blendshape {name!r} has one of the letters . : @ / % ", which Godot replaces; rename it'
            )


def write(path: Path, generation: Generation, _source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write one resource with a track for each weight of the motion."""
    motion = generation.motion
    lines = [
        *('[gd_resource type="Animation" format=3]', "", "[resource]", 'resource_name = "speech"'),
        *(f"length = {float(motion.time_s[-1]):.6g}", f"step = {1 / motion.rate_hz:.6g}"),
    ]
    names = [channel.name for channel in motion.channels if channel.unit == WEIGHT]
    for number, name in enumerate(names):
        values = np.asarray(np.round(motion[name].astype(np.float64), DECIMALS) + 0.0, np.float64)
        steps = name in generation.stepped
        kept = key_frames(motion.time_s, values, TOLERANCE, stepped=steps)
        keys = ", ".join(f"{motion.time_s[frame]:.6g}, 1, {values[frame]:.{DECIMALS}g}" for frame in kept)
        track = f"tracks/{number}"
        lines += [
            *(f'{track}/type = "blend_shape"', f"{track}/imported = false", f"{track}/enabled = true"),
            f"{track}/path = NodePath({json.dumps(f'{NODE}:{name}', ensure_ascii=False)})",
            *(f"{track}/interp = {NEAREST if steps else LINEAR}", f"{track}/loop_wrap = false"),
            f"{track}/keys = PackedFloat32Array({keys})",
        ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


MOTION_FORMAT = MotionFormat(write, check=check, curves="face", other_curves=True, keyed=True)
