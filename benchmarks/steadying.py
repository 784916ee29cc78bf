"""How still a face is after alignment by its maps: tracked, smoothed, and registered by the pictures.

    python benchmarks/steadying.py [--corpora ../shared/corpora] [--clips 6] [VIDEO ...]

Prints a JSON object a video and way of placing: the root mean square step from frame to frame of a part of the cheeks
(the left edge and the right edge of the registered region in turn), px of the picture. Registration itself uses only
the part between, so that its own noise is counted. ``fixed``: one map for all frames; ``speed``: of the tracked nose.
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

from lipmotion.vision import steadying
from lipmotion.vision.footage import Footage, footage_frames, track_footage
from lipmotion.vision.frames import VideoSpan
from lipmotion.vision.steadying import REGION, registered_maps, steady_maps

Array = NDArray[np.float64]
LONGEST = VideoSpan(0, 12)
MIDDLE = (-21.0, 2.0, 21.0, 44.0)
SIDES = ((REGION[0], REGION[1], MIDDLE[0], REGION[3]), (MIDDLE[2], REGION[1], REGION[2], REGION[3]))


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
        row = {"speed": step_px(np.diff(nose, axis=0))}
        row |= {way: jitter_px(replace(footage, face_to_image=maps)) for way, maps in ways(footage).items()}
        print(json.dumps({"video": path.stem, **{name: round(value, 3) for name, value in row.items()}}), flush=True)


def ways(footage: Footage) -> dict[str, Array]:
    """Return maps of every way."""
    raw, rate_hz, cuts = footage.face_to_image, footage.rate_hz, footage.cuts
    with patch.object(steadying, "REGION", MIDDLE):
        registered = registered_maps(footage)
    gaussians = {f"gaussian {sigma:g}": gaussian_filter1d(raw, sigma, axis=0, mode="nearest") for sigma in (1, 2, 4)}
    return {
        "tracked": raw,
        **gaussians,
        "fixed": np.repeat(raw.mean(axis=0)[None], len(raw), axis=0),
        "steady": steady_maps(raw, rate_hz, cuts),
        "registered": registered,
        "registered, steady": steady_maps(registered, rate_hz, cuts),
    }


def jitter_px(footage: Footage) -> float:
    """Return the root mean square step of the sides of the cheeks."""
    scale = float(np.sqrt(np.abs(np.linalg.det(footage.face_to_image[:, :, :2]))).mean())
    steps = []
    for side in SIDES:
        before = None
        with patch.object(steadying, "REGION", side):
            for n, (frame, to_image) in enumerate(zip(footage_frames(footage), footage.face_to_image, strict=True)):
                region = steadying._blurred_region(frame, to_image, scale)
                if before is not None and n not in footage.cuts and footage.track.seen[n - 1 : n + 1].all():
                    steps.append(steadying._step(before, region))
                before = region
    return step_px(np.array(steps))


def step_px(steps: Array) -> float:
    """Return the root mean square length."""
    return float(np.sqrt(np.square(steps).sum(axis=1).mean()))


if __name__ == "__main__":
    main()
