import json
import os
from pathlib import Path

import numpy as np
import pytest

from children import run_child
from formats.examples import of_motion
from formats.examples import written as write
from lipmotion.articulation.lip_points import mouth_template
from lipmotion.errors import ExportError
from lipmotion.formats.bvh import CENTIMETRES
from lipmotion.meshes.fitting.blendshape_motion import move_points
from lipmotion.types import Channel, Generation, Motion, Span, Timeline, Unit

FRAMES = 60
BLENDER = os.environ.get("LIPMOTION_BPY_PYTHON", "")
"""A Python that has the package ``bpy``."""
IN_BLENDER = """
import bpy, json, sys
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_anim.bvh(filepath=sys.argv[1], axis_forward="Y", axis_up="Z", use_fps_scale=False, global_scale=1.0,
                        update_scene_fps=True, update_scene_duration=True)
armature, scene = bpy.context.object, bpy.context.scene
found = {"fps": scene.render.fps / scene.render.fps_base, "frames": {}}
found["bones"] = [bone.name for bone in armature.pose.bones]
for frame in (1, 20, 60):
    scene.frame_set(frame)
    found["frames"][frame] = {bone.name: list(bone.matrix.to_translation()) for bone in armature.pose.bones}
print("FOUND" + json.dumps(found))
"""


@pytest.fixture
def talking() -> Generation:
    time_s = np.arange(FRAMES) / 50
    opening = 0.01 + 0.15 * (time_s > 0.3) * np.sin(2 * np.pi * 2 * time_s) ** 2
    width = 0.6 + 0.03 * np.sin(2 * np.pi * time_s)
    motion = Motion(np.stack([opening, width], axis=1), 50.0, (Channel("opening"), Channel("width")))
    units = Timeline((Span(0.0, 0.3, Unit("sil")), Span(0.3, 1.2, Unit("aa"))))
    return of_motion(motion, units)


@pytest.fixture
def written(talking: Generation, tmp_path: Path) -> Path:
    return write(tmp_path / "a.bvh", talking)


def expected(talking: Generation) -> np.ndarray:
    """Return the places of the points in centimetres [shape=(T, 52, 3)]."""
    moved = move_points(talking.motion, talking.units).displacements
    return (mouth_template().places + moved) * CENTIMETRES


def test_hierarchy_and_motion(talking, written):
    lines = written.read_text().splitlines()
    names = [line.split()[1] for line in lines if line.strip().startswith(("ROOT", "JOINT"))]
    assert names == ["head", *(f"{'JAW' if j else 'LIP'}_{p}" for p, j in zip(*_points(), strict=True))]
    assert lines.count("{") + sum(line.strip() == "{" and line != "{" for line in lines) == 1 + 2 * 52
    channels = sum(int(line.split()[1]) for line in lines if line.strip().startswith("CHANNELS"))
    at = lines.index("MOTION")
    assert lines[at + 1 : at + 3] == [f"Frames: {FRAMES}", "Frame Time: 0.020000000"]
    rows = np.array([list(map(float, line.split())) for line in lines[at + 3 :]])
    assert rows.shape == (FRAMES, channels)
    assert not rows[:, :6].any()
    np.testing.assert_allclose(rows[:, 6:].reshape(FRAMES, 52, 3), expected(talking), atol=5.1e-6)


def _points():
    template = mouth_template()
    return template.points, template.jaw


@pytest.mark.long
@pytest.mark.skipif(not BLENDER, reason="LIPMOTION_BPY_PYTHON names no Python with the package bpy")
def test_blender_shows_the_same_places(talking, written, tmp_path):
    """Oracle: the importer of Blender."""
    (tmp_path / "look.py").write_text(IN_BLENDER)
    done = run_child([BLENDER, tmp_path / "look.py", written], check=True)
    found = json.loads(done.stdout.partition("FOUND")[2].splitlines()[0])
    assert found["fps"] == pytest.approx(50.0)
    assert len(found["bones"]) == 53
    places = expected(talking)
    for frame, bones in found["frames"].items():
        for number, (point, jaw) in enumerate(zip(*_points(), strict=True)):
            x, y, z = bones[f"{'JAW' if jaw else 'LIP'}_{point}"]
            np.testing.assert_allclose([x, y, z], places[int(frame) - 1, number], atol=1e-4)


def test_what_cannot_be_placed_is_refused(tmp_path, talking):
    other = Motion(np.zeros((3, 1)), 50.0, (Channel("jawOpen", "weight"),))
    with pytest.raises(ExportError, match="no channel 'opening' to place lip points by"):
        write(tmp_path / "a.bvh", of_motion(other, talking.units))
