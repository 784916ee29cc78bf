"""Run in Blender: keys a face and a rig from a motion file by the add-on, or by a script; prints what is evaluated.

    blender_keys.py legacy|extension ADDON.zip MOTION SOUND NAMES.json
    blender_keys.py script SCRIPT.py NAMES.json
NAMES.json: names of shape keys. The face has each as it is and, on a second object, spelt with _L and _R.
"""

from __future__ import annotations

import json
import math
import os
import re
import sys
from pathlib import Path
from typing import Any

import bpy

kind, program = sys.argv[1:3]
names = json.loads(Path(sys.argv[-1]).read_text(encoding="utf-8"))
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene


def face(name: str, spelt: list[str]) -> Any:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    made = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(made)
    for key in ("Basis", *spelt):
        made.shape_key_add(name=key)
    return made


def rig() -> Any:
    made = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    scene.collection.objects.link(made)
    bpy.context.view_layer.objects.active = made
    bpy.ops.object.mode_set(mode="EDIT")
    bone = made.data.edit_bones.new("jaw.master")
    bone.head, bone.tail = (0, 0, 0), (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    made.pose.bones["jaw.master"]["open"] = 0.0
    made["lips"] = 0.0
    return made


first = face("face", names)
other = face("other", [re.sub("Left$", "_L", re.sub("Right$", "_R", name)) for name in names])
bones = rig()
earlier = first.data.shape_keys.key_blocks[1]
for frame in (2.0, 500.0):
    earlier.value = 0.9
    earlier.keyframe_insert("value", frame=frame)
for each in (first, other, bones):
    each.select_set(True)
answer: list[str] = []
if kind == "script":
    exec(  # noqa: S102
        compile(Path(program).read_text(encoding="utf-8"), program, "exec"),
        {"__name__": "__main__", "__file__": program},
    )
else:
    if kind == "legacy":
        bpy.ops.preferences.addon_install(filepath=program)
        bpy.ops.preferences.addon_enable(module="lipmotion_blender")
    else:
        bpy.ops.extensions.package_install_files(filepath=program, repo="user_default", enable_on_install=True)
    scene.lipmotion.motion, scene.lipmotion.sound = sys.argv[3:5]
    for _ in range(2):  # keying again changes nothing
        answer = list(bpy.ops.lipmotion.key())
moving = first.data.shape_keys
action = moving.animation_data.action
if hasattr(action, "slots"):  # since 4.4
    curves = action.layers[0].strips[0].channelbag(moving.animation_data.action_slot).fcurves
else:
    curves = action.fcurves
points = curves[0].keyframe_points
last = math.ceil(max(point.co[0] for point in points))
frames = []
for frame in range(1, last + 1):
    scene.frame_set(frame)
    jaw = bones.pose.bones["jaw.master"]
    keys = first.data.shape_keys.key_blocks[1:]
    frames.append(
        {"face": [key.value for key in keys], "other": [key.value for key in other.data.shape_keys.key_blocks[1:]],
         "jaw": math.degrees(jaw.rotation_euler.x), "open": jaw["open"], "lips": bones["lips"]}
    )  # fmt: skip
editor = scene.sequence_editor
strips = [] if editor is None else [strip.name for strip in getattr(editor, "strips", getattr(editor, "sequences", []))]
found = {"version": bpy.app.version_string, "fps": scene.render.fps, "answer": answer, "frames": frames}
found["plays_sound"] = bpy.app.build_options.audaspace
print(json.dumps(found | {"last": last, "end": scene.frame_end, "strips": strips}))
sys.stdout.flush()
os._exit(0)  # bpy 4.2 may crash when it is unloaded
