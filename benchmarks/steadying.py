"""How still a face is after alignment by its maps: tracked, smoothed, and registered by the pictures.

    python benchmarks/steadying.py [--corpora ../shared/corpora] [--clips 6] [VIDEO ...]

Prints a JSON object a video and way of placing: how far one half of nose and cheeks (left and right in turn) moves from
frame to frame after alignment, px of the picture, root mean square and median. Registration uses only the other half,
so that its own noise is counted, and is twice as noisy as in use. ``fixed``: one map for all frames; ``speed``: of the
tracked nose.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from lipmotion_faces.tracking import steadying
from lipmotion_faces.tracking.footage import Footage, footage_frames, track_footage
from lipmotion_faces.tracking.frames import VideoSpan
from lipmotion_faces.tracking.steadying import REGION, REGISTERED_NOISE_PX, registered_maps, steady_maps

Array = NDArray[np.float64]
LONGEST = VideoSpan(0, 5)
HALVES = ((REGION[0], REGION[1], 0.0, REGION[3]), (0.0, REGION[1], REGION[2], REGION[3]))


def main() -> None:
    """Print one JSON object a video and way."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpora", type=Path, default=Path("../shared/corpora"))
    parser.add_argument("--clips", type=int, default=6)
    parser.add_argument("videos", nargs="*", type=Path)
    options = parser.parse_args()
    grid = options.corpora / "grid-s1"
    names = (grid / "val.txt").read_text().split()[: options.clips]
    for path in (*(grid / "clips" / f"{name}.mkv" for name in names), *options.videos):
        footage = track_footage(path, LONGEST)
        nose = footage.face_to_image @ np.array([0, 30.0, 1])
        steps: dict[str, list[NDArray[np.float64]]] = {"speed": [np.diff(nose, axis=0)]}
        for used, seen in (HALVES, HALVES[::-1]):
            for way, maps in ways(footage, used).items():
                steps.setdefault(way, []).append(steps_of(replace(footage, face_to_image=maps), seen))
        for way, parts in steps.items():
            lengths = np.linalg.norm(np.concatenate(parts), axis=1)
            found = {"rms": np.sqrt(np.square(lengths).mean()), "median": np.median(lengths)}
            rounded = {name: round(float(value), 3) for name, value in found.items()}
            print(json.dumps({"video": path.stem, "way": way, **rounded}), flush=True)


def ways(footage: Footage, used: tuple[float, float, float, float]) -> dict[str, Array]:
    """Return maps of every way. ``used`` : the region that is registered."""
    raw, rate_hz, cuts = footage.face_to_image, footage.rate_hz, footage.cuts
    with patch.object(steadying, "REGION", used):
        registered = registered_maps(footage)
    gaussians = {f"gaussian {sigma:g}": gaussian_filter1d(raw, sigma, axis=0, mode="nearest") for sigma in (1, 2)}
    return {
        "tracked": raw,
        **gaussians,
        "fixed": np.repeat(raw.mean(axis=0)[None], len(raw), axis=0),
        "steady": steady_maps(raw, rate_hz, cuts),
        "registered": registered,
        "registered, smoothed": steady_maps(registered, rate_hz, cuts),
        "registered, steady": steady_maps(registered, rate_hz, cuts, noise_px=REGISTERED_NOISE_PX),
    }


def steps_of(footage: Footage, region: tuple[float, float, float, float]) -> Array:
    """Return how far a region moves from frame to frame, px of the picture [shape=(N, 2)]."""
    scale = float(np.sqrt(np.abs(np.linalg.det(footage.face_to_image[:, :, :2]))).mean())
    steps, before = [], None
    with patch.object(steadying, "REGION", region):
        for n, (frame, to_image) in enumerate(zip(footage_frames(footage), footage.face_to_image, strict=True)):
            after = steadying._blurred_region(frame, to_image, scale)
            if before is not None and n not in footage.cuts and footage.track.seen[n - 1 : n + 1].all():
                steps.append(steadying._step(before, after))
            before = after
    return np.array(steps)


if __name__ == "__main__":
    main()
