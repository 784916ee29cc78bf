"""What exchange formats lose: the example in two moods, written, read again and drawn, against what is drawn of itself.

python benchmarks/exchange.py examples/welcome.flac examples/welcome.txt
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import lipmotion
from lipmotion import Delivery
from lipmotion.articulation.delivery import closed_times
from lipmotion.articulation.liveliness import UPPER_FACE_UNITS
from lipmotion.articulation.mouth import spoken_mouth
from lipmotion.meshes.fitting.blendshape_motion import with_mouth
from lipmotion.meshes.fitting.eyes_and_brows import given_movements, moves_by_itself
from lipmotion.pipeline.outputs.delivered import delivered
from lipmotion.pipeline.outputs.motion_input import read_generation
from lipmotion.types import Motion, Timeline, Unit
from lipmotion_faces.base import Staging, alive

Array = NDArray[np.float64]
MOODS = "happy, angry at 2, surprised at 4"
SUFFIXES = (".livelink.csv", ".a2f.json", ".vmd", ".vrma", ".glb", ".cues.tsv", ".cues.xml", ".cues.dat", ".cues.pgo")
FPS = 60.0
PARTS = {"blinks": "lids", "gaze": "gaze", "brows": "brows", "head": "head"}
"""What a face moves by itself where a file does not say it."""


def shown(motion: Motion, units: Timeline[Unit], seed: int) -> dict[str, Array]:
    """Return what a face shows: the gap of the lips, and what moves beside them [each shape=(T, ...)]."""
    drawn = with_mouth(motion)
    mouth = spoken_mouth(drawn, units, FPS)
    moved = alive(np.arange(len(mouth.gap)) / FPS, drawn, units, Staging(seed=seed))
    mood = np.stack([moved.unit(unit) for unit in UPPER_FACE_UNITS.values()], axis=1)
    raised = 12 * moved.brows[:, None]
    brows = mood[:, :3] + raised * (1.0, 0.6, 0.0)
    corners = mouth.smile + moved.unit(12) - mouth.frown - moved.unit(15)
    curves = {"lips": mouth.gap, "corners": corners, "lids": moved.lids, "brows": brows}
    return curves | {
        "lids": moved.lids,
        "brows": brows,
        "cheeks, nose": mood[:, 3:],
        "gaze": moved.gaze,
        "head": moved.turn,
    }


def alike(one: Array, other: Array) -> str:
    """Return the correlation of two sets of curves over all their frames, as text."""
    frames = min(len(one), len(other))
    a, b = (np.atleast_2d(each[:frames].T) for each in (one, other))
    a, b = a - a.mean(axis=1, keepdims=True), b - b.mean(axis=1, keepdims=True)
    scale = np.sqrt((a**2).sum() * (b**2).sum())
    return f"{(a * b).sum() / scale:.2f}" if scale else "none"


def main() -> None:
    """Print a row for each format."""
    speech, transcript = map(Path, sys.argv[1:3])
    generation = lipmotion.animate(speech, transcript=transcript.read_text(encoding="utf-8"))
    whole = delivered(generation, Delivery(mood=MOODS))
    own, closed_s = shown(whole.motion, whole.units, 0), np.array(closed_times(whole))
    print("| file |", " | ".join(own), "| lips closed |")
    with tempfile.TemporaryDirectory() as folder:
        for suffix in SUFFIXES:
            path = Path(folder) / f"a{suffix}"
            if "cues" in suffix:
                lipmotion.write_cues(lipmotion.cues(generation), path)
            else:
                lipmotion.write(generation, path, face="head", delivery=Delivery(mood=MOODS))
            read = read_generation(path)
            found = shown(read.motion, read.units, 7)
            given = given_movements(read.motion, read.motion.time_s)
            left = {PARTS[part] for part in PARTS if moves_by_itself(part, given)}
            rows = ["own" if name in left else alike(curve, found[name]) for name, curve in own.items()]
            frames = np.rint(closed_s * FPS).astype(int)
            near = np.stack(
                [found["lips"][np.clip(frames + by, 0, len(found["lips"]) - 1)] for by in (-2, -1, 0, 1, 2)]
            )
            closed = f"{int((near == 0).any(axis=0).sum())} of {len(frames)}"
            print(f"| `{suffix}` | {' | '.join(rows)} | {closed} |")


if __name__ == "__main__":
    main()
