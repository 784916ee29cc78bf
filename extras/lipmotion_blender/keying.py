"""Keys for Blender: curves become keys of shape keys, bones and custom properties. Runs inside Blender, 4.2 and later;
no imports of lipmotion.
"""

from __future__ import annotations

import math
import os
from typing import Any

from .curves import Curves, at_frames, control, matched, read_motion

AXES = {"x": 0, "y": 1, "z": 2}
STRIP = "lipmotion sound"


def key_objects(
    objects: list[Any], motion: str, scene: Any, *, first: float = 1.0, replace: bool = True, sound: str = ""
) -> tuple[int, list[str]]:
    """Key objects from a motion file; return how many curves were used, and the names of those that were not.

    first   : the frame at which the motion begins
    replace : delete all earlier keys of what is keyed; otherwise only those in the range of the motion
    sound   : a file for the sequencer; empty: none
    Raises ValueError, OSError: the file cannot be read.
    """
    curves, times = read_motion(motion)
    frames = at_frames(curves, times, frame_rate(scene))
    return key_frames(objects, frames, scene, first=first, replace=replace, sound=sound)


def key_frames(
    objects: list[Any],
    frames: Curves,
    scene: Any,
    *,
    first: float = 1.0,
    replace: bool = True,
    sound: str = "",
    sound_s: float = 0.0,
    stepped: tuple[str, ...] = (),
) -> tuple[int, list[str]]:
    """Key objects from curves with one value a frame; arguments and what is returned as of ``key_objects``.

    sound_s : when the sound begins, in seconds after the first frame; negative: before it
    stepped : names of curves that hold each value until the next one
    """
    used: set[str] = set()
    named = {name: control(name) for name in frames}
    controls = {name: found for name, found in named.items() if found}
    for each in objects:
        if getattr(each.data, "shape_keys", None):
            keys = matched(list(frames), [block.name for block in each.data.shape_keys.key_blocks[1:]])
            key_shapes(each, frames, keys, first, replace=replace, stepped=stepped)
            used |= set(keys)
        used |= set(key_controls(each, frames, controls, first, replace=replace, stepped=stepped))
    if used:
        last = first + max(len(values) for values in frames.values()) - 1
        scene.frame_end = max(scene.frame_end, math.ceil(last))
        add_sound(scene, sound, first, sound_s)
    return len(used), [name for name in frames if name not in used]


def key_shapes(
    mesh: Any,
    curves: Curves,
    keys: dict[str, str],
    first: float,
    *,
    replace: bool = True,
    stepped: tuple[str, ...] = (),
) -> int:
    """Key shape keys of an object, one key a frame; return how many are keyed.

    curves  : by name, one value a frame, the first at the frame ``first``
    keys    : the shape key of each curve, as of ``matched``
    replace : delete all earlier keys of these shape keys; otherwise only those between the first and the last frame
    stepped : names of curves that hold each value until the next one
    """
    shapes = mesh.data.shape_keys
    fcurves = _fcurves(shapes, f"{mesh.name} speech") if keys else None
    for name, key in keys.items():
        shapes.key_blocks[key].slider_min = min(shapes.key_blocks[key].slider_min, min(curves[name], default=0.0))
        shapes.key_blocks[key].slider_max = max(shapes.key_blocks[key].slider_max, max(curves[name], default=0.0))
        kind = "CONSTANT" if name in stepped else "LINEAR"
        _key(fcurves, f'key_blocks["{_escape(key)}"].value', -1, curves[name], first, replace, kind)
    return len(keys)


def key_controls(
    rig: Any,
    curves: Curves,
    controls: dict[str, tuple[str, str, str]],
    first: float,
    *,
    replace: bool = True,
    stepped: tuple[str, ...] = (),
) -> list[str]:
    """Key bones and custom properties of an object, one key a frame; return the curves that found their control.

    controls : of each curve, as of ``control``; rotations are in degrees
    stepped  : names of curves that hold each value until the next one
    """
    keyed = []
    fcurves = None
    for name, (bone, kind, axis) in controls.items():
        owner = rig.pose.bones.get(bone) if bone and getattr(rig, "pose", None) else (rig if not bone else None)
        if owner is None or (kind == "property" and axis not in owner.keys()):  # noqa: SIM118
            continue
        inside = f'pose.bones["{_escape(bone)}"]' if bone else ""
        if kind == "property":
            path, index = f'{inside}["{_escape(axis)}"]', -1
        else:
            path, index = f"{inside}.{'rotation_euler' if kind == 'rotation' else kind}", AXES[axis]
        fcurves = fcurves if fcurves is not None else _fcurves(rig, f"{rig.name} speech")
        values = curves[name]
        if kind == "rotation":
            rig.pose.bones[bone].rotation_mode = "XYZ"
            values = [math.radians(value) for value in values]
        _key(fcurves, path, index, values, first, replace, "CONSTANT" if name in stepped else "LINEAR")
        keyed.append(name)
    return keyed


def add_sound(scene: Any, path: str, first: float, sound_s: float = 0.0) -> bool:
    """Add a sound to the sequencer, in place of an earlier one of its kind; return whether it is there.

    sound_s : it begins so many seconds after the frame ``first``; of a sound that begins before, the rest is heard
    """
    if not path or not os.path.isfile(path):  # noqa: PTH113
        return False
    editor = scene.sequence_editor or scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    for strip in [strip for strip in strips if strip.name == STRIP]:
        strips.remove(strip)
    taken = {strip.channel for strip in strips}
    channel = next(number for number in range(1, 130) if number not in taken)
    try:
        strip = strips.new_sound(STRIP, path, channel, round(first + sound_s * frame_rate(scene)))
    except RuntimeError:  # no sound file, or a Blender that was built without sound
        return False
    if sound_s < 0:
        strip.frame_final_start = round(first)
    scene.sync_mode = "AUDIO_SYNC"
    return True


def frame_rate(scene: Any) -> float:
    """Return the frames per second of a scene."""
    return float(scene.render.fps / scene.render.fps_base)


def _fcurves(owner: Any, name: str) -> Any:
    """Return the curves of the action of a data-block; since Blender 4.4 an action has layers and slots."""
    import bpy

    data = owner.animation_data or owner.animation_data_create()
    if data.action is None:
        data.action = bpy.data.actions.new(name)
    action = data.action
    if not hasattr(action, "slots"):
        return action.fcurves
    if data.action_slot is None:
        data.action_slot = action.slots.new(id_type=owner.id_type, name=owner.name)
    layer = action.layers[0] if action.layers else action.layers.new("Layer")
    strip = layer.strips[0] if layer.strips else layer.strips.new(type="KEYFRAME")
    return strip.channelbag(data.action_slot, ensure=True).fcurves


def _key(
    fcurves: Any, path: str, index: int, values: list[float], first: float, replace: bool, interpolation: str
) -> None:
    """Write one key a frame."""
    where = {"index": index} if index >= 0 else {}
    curve = fcurves.find(path, **where) or fcurves.new(path, **where)
    last = first + len(values) - 1
    others = [
        (point.co[0], point.co[1], point.interpolation)
        for point in curve.keyframe_points
        if not replace and not first - 0.5 < point.co[0] < last + 0.5
    ]
    points = sorted([*others, *((first + number, value, interpolation) for number, value in enumerate(values))])
    curve.keyframe_points.clear()
    curve.keyframe_points.add(len(points))
    curve.keyframe_points.foreach_set("co", [number for point in points for number in point[:2]])
    for point, (_, _, kind) in zip(curve.keyframe_points, points):  # noqa: B905
        point.interpolation = kind
    curve.update()


def _escape(name: str) -> str:
    return name.replace("\\", "\\\\").replace('"', '\\"')
