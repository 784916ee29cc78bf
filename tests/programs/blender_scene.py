"""Run in Blender: imports a .glb, .fbx or .usda; prints its shape keys, and the head's turn, at some times."""

from __future__ import annotations

import json
import os
import sys

import bpy

path, times_s = sys.argv[1], list(map(float, sys.argv[2:]))
bpy.ops.wm.read_factory_settings(use_empty=True)
if path.endswith(".glb"):
    bpy.ops.import_scene.gltf(filepath=path)
elif path.endswith(".fbx"):
    bpy.context.scene.render.fps = 60
    bpy.ops.import_scene.fbx(filepath=path, anim_offset=0)
else:
    bpy.ops.wm.usd_import(filepath=path)
scene = bpy.context.scene
fps = scene.render.fps / scene.render.fps_base
faces = [each for each in scene.objects if each.type == "MESH" and each.data.shape_keys]
rigs = [each for each in scene.objects if each.type == "ARMATURE" and "head" in each.pose.bones]
values, turns, moved = [], [], []
for time_s in times_s:
    frame = time_s * fps
    scene.frame_set(int(frame), subframe=frame - int(frame))
    depsgraph = bpy.context.evaluated_depsgraph_get()
    values.append({key.name: key.value for face in faces for key in face.data.shape_keys.key_blocks[1:]})
    evaluated = faces[0].evaluated_get(depsgraph).to_mesh()
    moved.append([sum(vertex.co[axis] for vertex in evaluated.vertices) for axis in range(3)])
    if rigs:
        bone = rigs[0].evaluated_get(depsgraph).pose.bones["head"]
        turns.append(list((bone.matrix @ bone.bone.matrix_local.inverted()).to_quaternion()))
print(json.dumps({"version": bpy.app.version_string, "fps": fps, "values": values, "turns": turns, "moved": moved}))
sys.stdout.flush()
os._exit(0)  # bpy 4.2 may crash when it is unloaded
