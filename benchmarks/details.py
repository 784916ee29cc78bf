"""What each level of detail loses: curves, keys, bytes, and how far the mouth is off that of the level film.

python benchmarks/details.py examples/welcome.flac examples/welcome.txt
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import lipmotion
from lipmotion.articulation.delivery import closed_times
from lipmotion.meshes.fitting.blendshape_motion import with_mouth
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH
from lipmotion.pipeline.job import DETAILS
from lipmotion.types import WEIGHT, Channel, Motion

Array = NDArray[np.float64]
SUFFIXES = (".tres", ".anim", ".vmd", ".glb")
CLOSED = 0.02
"""Lips that are no further apart, in eye distances, are together."""


def curves(path: Path) -> dict[str, tuple[Array, Array]]:
    """Return times and values of the keys of a Godot animation, by the names of its tracks."""
    text = path.read_text(encoding="utf-8")
    names = re.findall(r'NodePath\("\.:(.*)"\)', text)
    rows = [np.array(keys.split(", "), float).reshape(-1, 3) for keys in re.findall(r"Float32Array\((.*)\)", text)]
    return {name: (row[:, 0], row[:, 2]) for name, row in zip(names, rows, strict=True)}


def sampled(tracks: dict[str, tuple[Array, Array]], names: list[str], time_s: Array) -> Array:
    """Return the curves at some times; those that are not there are 0 [shape=(T, N)]."""
    nothing = (np.zeros(1), np.zeros(1))
    return np.stack([np.interp(time_s, *tracks.get(name, nothing)) for name in names], axis=1)


def main() -> None:
    """Print a row for each level."""
    speech, transcript = map(Path, sys.argv[1:3])
    generation = lipmotion.animate(speech, transcript=transcript.read_text(encoding="utf-8"))
    time_s, closed_s = generation.motion.time_s, np.array(closed_times(generation))
    print("| level | curves | keys | largest error | mean error | lips closed | bytes: " + ", ".join(SUFFIXES))
    whole: dict[str, tuple[Array, Array]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for level, job in DETAILS.items():
            sizes = []
            for suffix in SUFFIXES:
                path = Path(folder) / f"{level}{suffix}"
                lipmotion.write(
                    generation,
                    path,
                    face="head",
                    rate_hz=None if suffix == ".vmd" else job.outputs.rate_hz,
                    delivery=job.delivery,
                    staging=job.staging,
                )
                sizes.append(path.stat().st_size)
            tracks = curves(Path(folder) / f"{level}.tres")
            whole = whole or tracks
            names = [name for name in whole if name in ARKIT_MOUTH]
            values = sampled(tracks, names, time_s)
            off = np.abs(values - sampled(whole, names, time_s))
            rate_hz = job.outputs.rate_hz or 100.0
            shown = np.rint(closed_s * rate_hz) / rate_hz
            weights = Motion(values, 100.0, tuple(Channel(name, WEIGHT) for name in names))
            gap = np.interp(shown, time_s, with_mouth(weights)["lip_gap"])
            keys = sum(len(times) for times, _ in tracks.values())
            closed = f"{int((gap <= CLOSED).sum())} of {len(gap)}"
            print(f"| {level} | {len(tracks)} | {keys} | {off.max():.3f} | {off.mean():.4f} | {closed} | {sizes}")


if __name__ == "__main__":
    main()
