"""Measures of characters: skinning, blendshapes of meshes that nobody here made, control points, rendering.

    python benchmarks/rig.py --skinning
    python benchmarks/rig.py CHARACTER... [--control-points] [--lip-points FILE.csv] [--speech FILE] [--transcript FILE]
        [--retrack] [--speed]

One JSON object a line. For each character: seconds to read it and to find its mouth. Of the motion that the shipped
model generates for the speech (default: the example): the correlation of opening and width of the mesh's own lip points
with the motion, the gap in p, b, m and in silence, the largest step of a weight in 10 ms. ``retrack``: the same
correlations, as the project's tracker finds them in the rendered video. ``speed``: pictures at 720p in a second of one
core. Seconds are those of the processor, whatever else the machine does.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

import lipmotion
from lipmotion.articulation.lip_points import LEFT_CORNER, LOWER_MIDDLE, RIGHT_CORNER, UPPER_MIDDLE
from lipmotion.meshes.files.character_files import read_character
from lipmotion.meshes.fitting.driven import DrivenCharacter, driven_character
from lipmotion.meshes.fitting.point_motion import point_motion
from lipmotion.meshes.model.binding import skinned
from lipmotion.units import LIP_CLOSING, is_silent
from lipmotion_faces.mesh import MeshFace

EXAMPLES = Path(__file__).parents[1] / "examples"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("characters", nargs="*", type=Path)
    parser.add_argument("--skinning", action="store_true")
    parser.add_argument("--control-points", action="store_true")
    parser.add_argument("--lip-points", type=Path)
    parser.add_argument("--speech", type=Path, default=EXAMPLES / "welcome.flac")
    parser.add_argument("--transcript", type=Path, default=EXAMPLES / "welcome.txt")
    parser.add_argument("--retrack", action="store_true")
    parser.add_argument("--speed", action="store_true")
    options = parser.parse_args()
    if options.skinning:
        show(skinning_speed())
    if options.characters:
        spoken = lipmotion.animate(options.speech, transcript=options.transcript)
        for path in options.characters:
            show(measured(path, spoken, options))


def skinning_speed(vertices: int = 10_000, controls: int = 52, weights: int = 8) -> dict[str, object]:
    """Frames in a second of one core, median of nine."""
    draw = np.random.default_rng(0)
    numbers = np.sort(draw.permuted(np.tile(np.arange(controls), (vertices, 1)), axis=1)[:, :weights], axis=1)
    values = draw.dirichlet(np.ones(weights), vertices)
    starts = np.arange(0, vertices * weights + 1, weights)
    matrix = csr_array((values.reshape(-1), numbers.reshape(-1), starts), shape=(vertices, controls))
    matrices, places = draw.normal(size=(controls, 3, 4)), draw.normal(size=(vertices, 3))
    times = []
    for _ in range(9):
        start = time.process_time()
        for _ in range(50):
            skinned(matrix, matrices, places)
        times.append((time.process_time() - start) / 50)
    return {"measure": "skinning", "vertices": vertices, "frames_per_cpu_s": round(1 / float(np.median(times)))}


def measured(path: Path, spoken: lipmotion.Generation, options: argparse.Namespace) -> dict[str, object]:
    """What is measured of one character."""
    start = time.process_time()
    mesh = read_character(path)
    read_s = time.process_time() - start
    start = time.process_time()
    character = driven_character(path, points=options.lip_points, by_points=options.control_points)
    found_s = time.process_time() - start - read_s
    result: dict[str, object] = {
        "character": path.name,
        "moved_by": character.shapes.style if character.shapes else "control points",
        "vertices": len(mesh.vertices),
        "blendshapes": len(character.shapes.names) if character.shapes else 0,
        "read_s": round(read_s, 2),
        "found_s": round(max(found_s, 0.0), 2),
    }
    result |= on_the_mesh(character, spoken)
    if options.retrack:
        result |= retracked(character, spoken)
    if options.speed:
        start = time.process_time()
        count = sum(1 for _ in MeshFace(character).render(spoken.motion, spoken.units))
        result["frames_per_cpu_s_720p"] = round(count / (time.process_time() - start), 1)
    return result


def on_the_mesh(character: DrivenCharacter, spoken: lipmotion.Generation) -> dict[str, object]:
    """Opening, width and closures of the mesh's own lip points against the motion."""
    motion, units, placement = spoken.motion, spoken.units, character.placement
    rows = placement.vertices[[placement.row(p) for p in (UPPER_MIDDLE, LOWER_MIDDLE, RIGHT_CORNER, LEFT_CORNER)]]
    start = time.process_time()
    places = np.stack([vertices[rows] for vertices in character.vertices(motion, units, motion.time_s)])
    seconds = time.process_time() - start
    moved = placement.to_motion(places - character.mesh.vertices[rows])
    gap, width = moved[:, 0, 1] - moved[:, 1, 1], moved[:, 3, 0] - moved[:, 2, 0]
    wanted = point_motion(motion, units).gap
    closing, silent = (
        [span for span in units if test(span.label.phone)] for test in (LIP_CLOSING.__contains__, is_silent)
    )
    at = [(motion.time_s >= span.start_s) & (motion.time_s < span.end_s) for span in closing]
    meant = [here for here in at if here.any() and wanted[here].min() <= 0]
    rest = np.zeros(len(gap), bool)
    for span in silent:
        rest |= (motion.time_s >= span.start_s + 0.1) & (motion.time_s < span.end_s - 0.1)
    result: dict[str, object] = {
        "opening": correlation(gap, motion["opening"]),
        "width": correlation(width, motion["width"]),
        "width_std_ratio": round(float(width.std() / motion["width"].std()), 2),
        "closed_pbm": f"{sum(bool(gap[here].min() < 0.004) for here in meant)} of {len(meant)}",
        "largest_gap_in_silence": round(float(gap[rest].max(initial=0.0)), 4),
        "real_time_factor": round(seconds / motion.time_s[-1], 3),
    }
    if character.shapes is not None:
        weights = character.weights(motion, units)
        result["range"] = [round(float(weights.values.min()), 4), round(float(weights.values.max()), 4)]
        result["largest_step_10ms"] = round(float(np.abs(np.diff(weights.values, axis=0)).max()), 3)
        result["largest_weight_in_silence"] = round(float(weights.values[rest].max(initial=0.0)), 3)
    return result


def retracked(character: DrivenCharacter, spoken: lipmotion.Generation) -> dict[str, object]:
    """The same correlations, by the project's tracker in the rendered video."""
    from lipmotion_faces.tracking.track import track

    with tempfile.TemporaryDirectory() as folder:
        video = Path(folder) / "character.mp4"
        lipmotion.write(spoken, video, speech=EXAMPLES / "welcome.flac", face=MeshFace(character))
        found = track(video, crops=False).motion
    times = found.time_s[found.time_s <= spoken.motion.time_s[-1]]
    given = spoken.motion.at(times)
    columns = {name: spoken.motion.column(name) for name in ("opening", "width")}
    seen = {name: found[name][: len(times)] for name in columns}
    return {f"retracked_{name}": correlation(seen[name], given[:, column]) for name, column in columns.items()}


def correlation(one: np.ndarray, other: np.ndarray) -> float:
    return round(float(np.corrcoef(one, other)[0, 1]), 3)


def show(result: dict[str, object]) -> None:
    sys.stdout.write(json.dumps(result) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
