"""The end of a script for Blender: it stands after the code of the add-on, and after the curves."""

from __future__ import annotations

import os
from typing import Any

from .curves import Curves, at_frames
from .keying import frame_rate, key_frames

MOTION: Curves = {}
RATE_HZ = 100.0
SOUND = ""
SOUND_S = 0.0
STEPPED: tuple[str, ...] = ()
# -- what follows is copied into scripts


def main() -> None:
    """Key the selected objects, or all of the scene where none of these has anything to key."""
    import bpy

    scene = bpy.context.scene
    count = max((len(values) for values in MOTION.values()), default=0)
    frames = at_frames(MOTION, [number / RATE_HZ for number in range(count)], frame_rate(scene), STEPPED)
    chosen = [each for each in scene.objects if each.select_get()]
    for objects in (chosen, list(scene.objects)):
        options = {"first": scene.frame_start, "sound": _sound_file(bpy), "sound_s": SOUND_S, "stepped": STEPPED}
        used, left = key_frames(objects, frames, scene, **options)
        if used:
            print(f"lipmotion: {used} curves keyed; without a shape key or bone: {', '.join(left) or 'none'}")
            return
    raise RuntimeError(f"no shape key or bone has the name of a curve: {', '.join(list(MOTION)[:4])}, ...")


def _sound_file(bpy: Any) -> str:
    """Return the sound, from the folder of this script or of the open file; empty: it is in neither."""
    folders = [os.path.dirname(os.path.abspath(__file__)), os.path.dirname(bpy.data.filepath)]  # noqa: PTH100, PTH120
    folders += [os.path.dirname(bpy.path.abspath(text.filepath)) for text in bpy.data.texts]  # noqa: PTH120
    places = [os.path.join(folder, SOUND) for folder in folders if folder and SOUND]  # noqa: PTH118
    return next((place for place in places if os.path.isfile(place)), "")  # noqa: PTH113
