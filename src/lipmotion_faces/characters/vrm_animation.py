"""``.vrma``: a VRM animation: the expressions ``aa`` ``ih`` ``ou`` ``ee`` ``oh`` and blinks, and the turns of the head.

Source: VRMC_vrm_animation 1.0 (VRM Consortium). The weight of an expression is the x of the translation of a node of
its own; the rest pose of the bones is a T-pose a metre high at the hips. In p, b and m all vowels are 0, and so are the
expressions of moods (``happy``, ``sad`` ...), which are there where a mood is.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.formats.base import MotionFormat
from lipmotion.meshes.model.mesh import ANGLES, turn_head
from lipmotion.meshes.model.shape_names import VRM_EMOTIONS, VRM_VOWELS
from lipmotion.types import Generation
from lipmotion_faces.characters.gltf_document import write_container
from lipmotion_faces.characters.gltf_weights import read_gltf_motion
from lipmotion_faces.characters.gltf_writer import GltfBuffer, describe_sound
from lipmotion_faces.characters.scene import with_jumps

Array = NDArray[np.float64]
EXTENSION = "VRMC_vrm_animation"
BLINKS = ("eyeBlinkLeft", "eyeBlinkRight")
BONES = {"hips": 1.0, "spine": 0.1, "head": 0.5}
"""The bones, each the parent of the next, and how far above its parent each is, in metres."""


def write(path: Path, generation: Generation, source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write a binary glTF without a mesh: bones, a node for each expression, and one animation of them."""
    motion, buffer = generation.motion, GltfBuffer()
    curves = {name: motion[name].astype(np.float64) for name in (*VRM_VOWELS, *VRM_EMOTIONS) if name in motion.names}
    if all(name in motion.names for name in BLINKS):
        left, right = (motion[name].astype(np.float64) for name in BLINKS)
        same = np.array_equal(left, right)
        curves |= {"blink": left} if same else {"blinkLeft": left, "blinkRight": right}
    curves = {name: np.clip(curve, 0, 1) for name, curve in curves.items()}
    stepped = [bool({*(BLINKS if name.startswith("blink") else (name,))} & {*generation.stepped}) for name in curves]
    time_s, rows = with_jumps(motion.time_s, np.stack(list(curves.values()), axis=1), stepped)
    nodes = [
        {"name": name, "translation": [0.0, up, 0.0], "children": [n + 1]} for n, (name, up) in enumerate(BONES.items())
    ]
    del nodes[-1]["children"]
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []

    def add(times: int, values: Array, kind: str, node: int, path: str) -> None:
        samplers.append({"input": times, "output": buffer.add(values, kind), "interpolation": "LINEAR"})
        channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})

    shared = buffer.add(time_s, "SCALAR", limits=True)
    preset: dict[str, dict[str, int]] = {}
    for name, column in zip(curves, rows.T, strict=True):
        preset[name] = {"node": len(nodes)}
        add(shared, np.pad(column[:, None], ((0, 0), (0, 2))), "VEC3", len(nodes), "translation")
        nodes.append({"name": f"expression {name}"})
    if all(name in motion.names for name in ANGLES):
        angles = np.stack([motion[name] for name in ANGLES], axis=1).astype(np.float64)
        frames = shared if len(time_s) == len(angles) else buffer.add(motion.time_s, "SCALAR", limits=True)
        add(frames, turn_head(angles), "VEC4", list(BONES).index("head"), "rotation")
    bones = {name: {"node": number} for number, name in enumerate(BONES)}
    scene: dict[str, Any] = {"nodes": [0, *range(len(BONES), len(nodes))]}
    if source.get("path"):
        scene["extras"] = describe_sound(source["path"], float(source.get("start_s", 0.0)))
    document = {
        "asset": {"version": "2.0", "generator": "lipmotion"},
        "extensionsUsed": [EXTENSION],
        "extensions": {
            EXTENSION: {"specVersion": "1.0", "humanoid": {"humanBones": bones}, "expressions": {"preset": preset}}
        },
        "scene": 0,
        "scenes": [scene],
        "nodes": nodes,
        "animations": [{"name": "speech", "channels": channels, "samplers": samplers}],
        "buffers": [{"byteLength": buffer.size}],
        "bufferViews": buffer.views,
        "accessors": buffer.accessors,
    }
    write_container(path, document, b"".join(buffer.chunks))


MOTION_FORMAT = MotionFormat(write, read_gltf_motion, curves="vowels", names_sound=True, needs=VRM_VOWELS, min_frames=2)
