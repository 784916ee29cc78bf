"""Draw docs/images/for-blender.png: moving.glb, imported and rendered by Blender (Cycles).

lipmotion animate examples/welcome.flac --transcript examples/welcome.txt -o moving.glb --rate 30
python scripts/page_blender.py moving.glb docs/images/for-blender.png     (needs the package bpy, and Pillow)
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import bpy
from mathutils import Vector
from PIL import Image

TIMES_S = (0.62, 0.8, 1.37, 2.2)
LIGHTS = (((-0.5, -0.9, 0.4), 9, 0.4), ((0.3, -0.9, -0.1), 4, 0.4), ((0.2, 0.7, 0.7), 10, 0.3))
"""Place from the mouth in metres, power in watts, size in metres."""


def main() -> None:
    """Import the scene, light it, and render it at some times."""
    source, target = map(Path, sys.argv[1:])
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(source))
    scene = bpy.context.scene
    speaking = next(each for each in bpy.data.objects if each.type == "MESH" and each.data.shape_keys)
    middle = speaking.matrix_world @ (sum(map(Vector, speaking.bound_box), Vector()) / 8)
    scene.camera = placed(bpy.data.cameras.new("camera"), middle, (0.1, -0.8, 0.03))
    scene.camera.data.lens = 85
    scene.camera.data.clip_start = 0.01
    for place, power, size in LIGHTS:
        light = bpy.data.lights.new("light", "AREA")
        light.energy, light.size = power, size
        placed(light, middle, place)
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.55, 0.65, 0.75, 1)
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 48
    scene.cycles.use_denoising = False
    scene.render.resolution_x, scene.render.resolution_y = 300, 340
    scene.view_settings.view_transform = "Standard"
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        for number, time_s in enumerate(TIMES_S):
            frame = time_s * scene.render.fps
            scene.frame_set(int(frame), subframe=frame - int(frame))
            scene.render.filepath = str(Path(folder) / f"{number}.png")
            bpy.ops.render.render(write_still=True)
            pictures.append(Image.open(scene.render.filepath).convert("RGB"))
    whole = Image.new("RGB", (sum(picture.width for picture in pictures), pictures[0].height))
    for number, picture in enumerate(pictures):
        whole.paste(picture, (number * picture.width, 0))
    whole.save(target, optimize=True)


def placed(data: object, middle: Vector, place: tuple[float, float, float]) -> object:
    """Add a camera or light to the scene, at a place relative to the middle, looking at it."""
    added = bpy.data.objects.new("placed", data)
    bpy.context.scene.collection.objects.link(added)
    added.location = middle + Vector(place)
    added.rotation_euler = (-Vector(place)).to_track_quat("-Z", "Y").to_euler()
    return added


if __name__ == "__main__":
    main()
