"""Turns a moving ``.glb`` into an ``.fbx`` with its blendshapes and joints moving, in Blender 4.2 or later:

blender --background --python examples/glb_to_fbx.py -- moving.glb moving.fbx
"""

import os
import sys

import bpy

source, target = sys.argv[-2:]
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = 60
bpy.ops.import_scene.gltf(filepath=source)
scene.frame_start, scene.frame_end = 0, int(max(action.frame_range[1] for action in bpy.data.actions))
bpy.ops.export_scene.fbx(
    filepath=target,
    bake_anim_use_all_actions=False,  # what is seen, as one animation
    bake_anim_use_nla_strips=False,
    bake_anim_simplify_factor=0,
    add_leaf_bones=False,
)
sys.stdout.flush()
os._exit(0)  # Blender as a Python module may crash when it is unloaded
