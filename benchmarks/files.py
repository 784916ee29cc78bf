"""Files for 3D programs, asked of these programs: is each valid, and does it play what was written?

    python benchmarks/files.py [CHARACTER.glb ...] [--folder FOLDER]

One JSON object a line. The example is animated, and written as .glb and .usda (with the 3D head, and with each
character that is named), .blender.py and .livelink.csv. Khronos' validator, OpenUSD and Blender are found as
tests/programs says: LIPMOTION_NODE_MODULES, LIPMOTION_PXR_PYTHON, LIPMOTION_BPY_PYTHON; what is absent is left out.
``largest_error``: between values that the program evaluates, at 40 times, and those that were written.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.extend(str(Path(__file__).parents[1] / folder) for folder in ("tests", "extras"))

import lipmotion
from lipmotion.formats.game_engines import write_addon
from lipmotion.pipeline.outputs.curve_sets import with_curves
from lipmotion.pipeline.outputs.output import measure_prosody
from lipmotion.types import Generation
from lipmotion_blender.curves import at_frames
from lipmotion_faces.characters.character_files import load_character
from lipmotion_faces.characters.scene import Scene
from lipmotion_faces.head.pose import list_head_poses
from lipmotion_faces.head.skin import COLUMNS, VISIBLE_RINGS
from lipmotion_faces.head.stage import build_head_mesh, fit_mouth_weights, make_figure
from lipmotion_faces.outputs.scenes import build_character_scene, build_head_scene, write_scene
from programs import gltf_report, gltf_validator, python_with, run_with

EXAMPLES = Path(__file__).parents[1] / "examples"
REPETITIONS = 40


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("characters", nargs="*", type=Path)
    parser.add_argument("--folder", type=Path, help="keep the files here")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        sound = folder / "welcome.flac"
        sound.write_bytes((EXAMPLES / sound.name).read_bytes())
        result = lipmotion.animate(sound, transcript=EXAMPLES / "welcome.txt")
        prosody = measure_prosody(sound)
        print(json.dumps(fit(result)), flush=True)
        makers = {"head": lambda: build_head_scene(result, prosody=prosody)}
        for path in options.characters:
            makers[path.stem] = lambda path=path: build_character_scene(result, load_character(path), prosody=prosody)
        for name, make in makers.items():
            started = time.process_time()
            scene = make()
            print(json.dumps({"scene": name, "seconds": round(time.process_time() - started, 2), **size(scene)}))
            for suffix in (".glb", ".usda"):
                started = time.process_time()
                path = folder / f"{name}{suffix}"
                write_scene(path, scene, sound)
                seconds = round(time.process_time() - started, 2)
                about = {"file": path.name, "bytes": path.stat().st_size, "seconds": seconds}
                print(json.dumps(about | asked(path, scene)), flush=True)
        keyed(folder, result, sound)


def fit(result: Generation) -> dict[str, object]:
    """Return how far the lips of the 3D head's mesh are from where its videos show them, in eye distances."""
    character = make_figure()
    mesh = build_head_mesh(character)
    poses = list_head_poses(result.motion, result.units, 100.0)
    curves = fit_mouth_weights(character, mesh, poses)
    lips = character.skin.list_lip_rows()[:VISIBLE_RINGS]
    rows, ring = lips.ravel(), slice((VISIBLE_RINGS - 1) * COLUMNS, VISIBLE_RINGS * COLUMNS)
    moved = mesh.displacements(rows)
    apart, gaps, closed = [], [], []
    for number, pose in enumerate(poses):
        summed = mesh.vertices[rows] + sum(
            curve[number] * moved[mesh.shape_names.index(name)] for name, curve in curves.items()
        )
        drawn = character.skin.place(pose)[rows]
        both = [gap_of(each[ring]) for each in (summed, drawn)]
        apart.append(float(np.abs(summed - drawn).max()))
        gaps.append(abs(both[0] - both[1]))
        closed += [both[0] - gap_of(mesh.vertices[rows][ring])] if abs(pose.gap) < 1e-9 else []
    about = {"frames": len(poses), "lips": max(apart), "median": float(np.median(apart))}
    return {"fit": about | {"gap": max(gaps), "closed": max(closed), "closed frames": len(closed)}}


def gap_of(edge: np.ndarray) -> float:
    """Return the largest gap between upper and lower lip along their edge [shape=(COLUMNS, 3)]."""
    half = COLUMNS // 2
    return float((edge[1:half] - edge[:half:-1])[:, 1].max())


def size(scene: Scene) -> dict[str, int]:
    """Return how large a scene is."""
    keys = len(scene.weights.values) if scene.weights else 0
    return {"vertices": len(scene.mesh.vertices), "shapes": len(scene.mesh.shapes), "keys": keys}


def asked(path: Path, scene: Scene) -> dict[str, object]:
    """Return what the programs say of a scene's file."""
    assert scene.weights is not None
    times_s = np.linspace(0, scene.weights.time_s[-1], REPETITIONS)
    found: dict[str, object] = {}
    if path.suffix == ".glb" and gltf_validator():
        report = gltf_report(path)
        counts = {name: report[name] for name in ("numErrors", "numWarnings", "numInfos", "numHints")}
        found["gltf-validator"] = {"version": report["version"], **counts}
        if scene.original is not None:
            before = gltf_report(scene.original)
            found["of the original"] = {name: before[name] for name in ("numErrors", "numWarnings")}
    if path.suffix == ".usda" and python_with("pxr"):
        usd = run_with("pxr", "usd_scene.py", path, *(24 * times_s))
        error = largest_error(scene, times_s, usd["values"])
        about = {"version": usd["version"], "validators": usd["validators"], "errors": len(usd["errors"])}
        found["OpenUSD"] = about | {"largest_error": error}
    if python_with("bpy"):
        found["Blender"] = played(path, scene, times_s)
    return found


def played(path: Path, scene: Scene, times_s: np.ndarray) -> dict[str, object]:
    """Return what Blender plays of a scene's file."""
    try:
        blender = run_with("bpy", "blender_scene.py", path, *times_s)
    except AssertionError as refusal:
        return {"refused": str(refusal).strip().splitlines()[-1]}
    return {"version": blender["version"], "largest_error": largest_error(scene, times_s, blender["values"])}


def largest_error(scene: Scene, times_s: np.ndarray, values: list[dict[str, float]]) -> float:
    """Return how far values of shapes at some times are from those of the scene."""
    assert scene.weights is not None
    wanted = dict(zip(scene.weights.names, scene.weights.at(times_s).T, strict=True))
    return max(abs(float(wanted[name][row]) - at[name]) for row, at in enumerate(values) for name in wanted)


def keyed(folder: Path, result: Generation, sound: Path) -> None:
    """Print how far the keys that the add-on and the script make are from the motion, at all frames."""
    curves, names = with_curves(result, "face", prosody=measure_prosody(sound))
    lipmotion.write(curves, [folder / "face.json", folder / "face.blender.py"], speech=sound, channels=names)
    lipmotion.write(curves, folder / "face.livelink.csv", speech=sound, rate_hz=100.0)
    write_addon("blender", folder / "addon.zip")
    listed = [name for name in names if not name.startswith("head")]
    (folder / "names.json").write_text(json.dumps(listed))
    wanted = at_frames({name: curves.motion[name].tolist() for name in listed}, curves.motion.time_s.tolist(), 24.0)
    expected = np.array([wanted[name] for name in listed]).T
    if not python_with("bpy"):
        return
    runs: dict[str, tuple[object, ...]] = {"script": ("script", folder / "face.blender.py", folder / "names.json")}
    for kind in ("legacy", "extension"):
        for motion in ("face.json", "face.livelink.csv"):
            files = (folder / "addon.zip", folder / motion, sound, folder / "names.json")
            runs[f"add-on ({kind}), {motion}"] = (kind, *files)
    for name, arguments in runs.items():
        user = Path(tempfile.mkdtemp(dir=folder))
        try:
            found = run_with("bpy", "blender_keys.py", *arguments, folder=user)
        except AssertionError as refusal:
            print(json.dumps({"keyed by": name, "refused": str(refusal).strip().splitlines()[-1]}))
            continue
        values = np.array([frame["face"] for frame in found["frames"]])
        error = float(np.abs(values - expected).max())
        about = {"keyed by": name, "version": found["version"], "frames": len(values), "shapes": len(listed)}
        print(json.dumps(about | {"largest_error": error}), flush=True)


if __name__ == "__main__":
    main()
