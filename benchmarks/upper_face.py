"""How far brows and head follow the voice: of tracked talkers against the accents that move our faces.

    python benchmarks/upper_face.py VIDEO ... --tracks FOLDER

Brows and head of each video are tracked with the face mesh and kept in the folder. What is compared is what moves
within 1.5 s: the height of the brows in the frame of the head, and the pitch of the head, against those of our faces
(``articulation.liveliness``, the mean of 32 seeds), as they are and earlier or later. The control is the same at other
times of the same recording, 400 draws; the interval is of clips that are drawn again, 2,000 times. Means are weighted
by duration.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from lipmotion.articulation.liveliness import liveliness
from lipmotion.pipeline.outputs.prosody import prosody_of_speech
from lipmotion.types import FRAME_RATE_HZ, Channel, Motion, Prosody, Timeline
from lipmotion_faces.tracking.head_pose import head_pose
from lipmotion_faces.tracking.landmarks import RIGID_POINTS
from lipmotion_faces.tracking.packages import import_face_mesh

Curve = NDArray[np.float64]
BROWS = (70, 63, 105, 66, 107, 300, 293, 334, 296, 336)
LAYOUT = sorted({*RIGID_POINTS, *BROWS})
TALLEST_PX = 800
SMOOTH_S, SLOW_S = 0.08, 1.5
EDGE_S = 0.4
DRAWS = 400
CLIP_DRAWS = 2000
SHIFTS_S = (-0.14, -0.1, -0.05, 0.0, 0.05)
SEEDS = 32


def tracked(video: Path, folder: Path) -> dict[str, Curve]:
    """Return times in seconds, height of the brows in eye distances and pitch of the head in radians."""
    kept = folder / f"{video.stem}.npz"
    if not kept.exists():
        times, places = [], []
        with import_face_mesh().FaceMesh(max_num_faces=1, refine_landmarks=True) as mesh, av.open(str(video)) as file:
            for frame in file.decode(video=0):
                image = frame.to_ndarray(format="rgb24")
                step = -(-len(image) // TALLEST_PX)
                image = np.ascontiguousarray(image[::step, ::step])
                found = mesh.process(image).multi_face_landmarks
                if found:
                    high, wide = image.shape[:2]
                    points = [found[0].landmark[index] for index in LAYOUT]
                    places.append([(p.x * wide, -p.y * high, -p.z * wide) for p in points])
                    times.append(float(frame.time))
        points = np.array(places)
        pose = head_pose(points, LAYOUT)
        brows = pose.to_head_coordinates(points)[:, [LAYOUT.index(point) for point in BROWS], 1].mean(axis=1)
        np.savez(kept, t=np.array(times), brow=brows, pitch=np.arcsin(np.clip(pose.rotation[:, 1, 2], -1, 1)))
    with np.load(kept) as arrays:
        return {name: arrays[name] for name in ("t", "brow", "pitch")}


def fast(curve: Curve) -> Curve:
    """Return a curve at 100 Hz without what moves slowly."""
    return np.asarray(curve - gaussian_filter1d(curve, SLOW_S * FRAME_RATE_HZ))


def correlation(first: Curve, second: Curve) -> float:
    """Return the correlation of two curves, without their edges."""
    edge = int(EDGE_S * FRAME_RATE_HZ)
    return float(np.corrcoef(first[edge:-edge], second[edge:-edge])[0, 1])


def moved(prosody: Prosody, count: int) -> tuple[Curve, Curve]:
    """Return brows, and pitch of the head, as our faces move them with a voice: the mean of many seeds."""
    time_s = np.arange(count) / FRAME_RATE_HZ
    still = Motion(np.zeros((count, 1)), FRAME_RATE_HZ, (Channel("opening"),))
    found = [liveliness(time_s, still, Timeline(()), prosody, seed=seed) for seed in range(SEEDS)]
    return np.mean([each.brows for each in found], axis=0), np.mean([each.turn[:, 1] for each in found], axis=0)


def compare(name: str, pairs: list[tuple[Curve, Curve]], later_s: float) -> None:
    """Print the mean correlation of ours, so much later, with theirs; its interval; and the control."""
    weights, draw = np.array([len(theirs) for _, theirs in pairs], float), np.random.default_rng(0)
    shift = round(later_s * FRAME_RATE_HZ)
    found = np.array([correlation(np.roll(ours, shift), theirs) for ours, theirs in pairs])
    control = [
        np.average([correlation(np.roll(a, draw.integers(100, len(a) - 100)), b) for a, b in pairs], weights=weights)
        for _ in range(DRAWS)
    ]
    chosen = draw.integers(0, len(pairs), (CLIP_DRAWS, len(pairs)))
    means = (found[chosen] * weights[chosen]).sum(axis=1) / weights[chosen].sum(axis=1)
    low, high = np.quantile(means, (0.025, 0.975))
    mean, least, most = np.average(found, weights=weights), *np.quantile(control, (0.025, 0.975))
    each = " ".join(f"{value:.2f}" for value in found)
    print(f"{name}, {later_s:+.2f} s: {mean:.3f} ({low:.3f} to {high:.3f}); control {least:.3f} to {most:.3f}; {each}")


def main() -> None:
    """Track, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("videos", nargs="+", type=Path)
    parser.add_argument("--tracks", type=Path, required=True)
    options = parser.parse_args()
    brows: list[tuple[Curve, Curve]] = []
    pitches: list[tuple[Curve, Curve]] = []
    for video in options.videos:
        track, prosody = tracked(video, options.tracks), prosody_of_speech(video)
        count = min(int(track["t"][-1] * FRAME_RATE_HZ), len(prosody.level_db))
        grid = np.arange(count) / FRAME_RATE_HZ
        for into, name, ours in zip((brows, pitches), ("brow", "pitch"), moved(prosody, count), strict=True):
            theirs = gaussian_filter1d(np.interp(grid, track["t"], track[name]), SMOOTH_S * FRAME_RATE_HZ)
            into.append((fast(ours), fast(theirs)))
    for shift_s in SHIFTS_S:
        compare("brows", brows, shift_s)
    compare("pitch of the head", pitches, 0.0)


if __name__ == "__main__":
    main()
