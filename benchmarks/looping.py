"""Joins of a background that is shown longer than it is: how much larger the steps there are than ordinary ones.

    python benchmarks/looping.py [--corpora ../shared/corpora] [--clips 4] [--seconds 120] [--sheet FOLDER] [VIDEO ...]

Prints a JSON object a video: its joins, their costs, and mean absolute differences of the frames shown at joins in all
pixels, relative to the median of neighbours; ``ordinary`` is the largest of neighbours that are no join. ``--sheet``:
the four frames before and after some joins of each video, to look at.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from lipmotion.appearance.frame_descriptors import describe_frames
from lipmotion.appearance.looping import FADE_FRAMES, LoopOrder, loop_order
from lipmotion.vision.footage import footage_frames, track_footage
from lipmotion.vision.frames import VideoSpan

LONGEST = VideoSpan(0, 20)
Frames = list[NDArray[np.uint8]]


def main() -> None:
    """Print one JSON object a video."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpora", type=Path, default=Path("../shared/corpora"))
    parser.add_argument("--clips", type=int, default=4)
    parser.add_argument("--seconds", type=float, default=120)
    parser.add_argument("--sheet", type=Path)
    parser.add_argument("videos", nargs="*", type=Path)
    options = parser.parse_args()
    grid = options.corpora / "grid-s1"
    names = (grid / "val.txt").read_text().split()[: options.clips]
    for path in (*(grid / "clips" / f"{name}.mkv" for name in names), *options.videos):
        footage = track_footage(path, LONGEST)
        frames = list(footage_frames(footage))
        descriptors = describe_frames(frames, footage.face_to_image)
        count = round(options.seconds * footage.rate_hz)
        order = loop_order(descriptors, count, footage.rate_hz, usable=footage.track.seen, cuts=footage.cuts)
        print(json.dumps({"video": path.stem, "frames": len(frames), **figures(frames, order)}), flush=True)
        if options.sheet:
            cv2.imwrite(str(options.sheet / f"{path.stem}.png"), sheet(frames, order)[:, :, ::-1])


def figures(frames: Frames, order: LoopOrder) -> dict[str, float]:
    """Return the figures of one order."""
    steps = np.array([difference(frames[n - 1], frames[n]) for n in range(1, len(frames))])
    usual = float(np.median(steps[steps > 0]))
    found: dict[str, float] = {"ordinary": round(steps.max() / usual, 2)}
    for kind in ("turn", "jump"):
        joins = [join for join in order.joins if join.kind == kind]
        found[f"{kind}s"] = len(joins)
        if joins:
            at = {n for join in joins for n in range(join.at - FADE_FRAMES, join.at + FADE_FRAMES)}
            near = [difference(shown(frames, order, n - 1), shown(frames, order, n)) for n in at if 0 < n < len(order)]
            found[f"{kind} cost"] = round(max(join.cost for join in joins), 2)
            found[f"{kind} step"] = round(max(near) / usual, 2)
    return found


def difference(first: NDArray[np.uint8], other: NDArray[np.uint8]) -> float:
    """Return the mean absolute difference of two frames."""
    return float(np.abs(first.astype(np.int16) - other).mean())


def shown(frames: Frames, order: LoopOrder, at: int) -> NDArray[np.uint8]:
    """Return a frame as it is shown."""
    weight = order.weight[at]
    blend = (1 - weight) * frames[order.first[at]] + weight * frames[order.second[at]]
    rounded: NDArray[np.uint8] = np.rint(blend).astype(np.uint8)
    return rounded


def sheet(frames: Frames, order: LoopOrder) -> NDArray[np.uint8]:
    """Return the frames around up to four turns and four jumps, a row each."""
    rows = []
    for kind in ("turn", "jump"):
        for join in [join for join in order.joins if join.kind == kind][:4]:
            near = np.clip(np.arange(join.at - 4, join.at + 4), 0, len(order) - 1)
            rows.append(np.hstack([cv2.resize(shown(frames, order, int(n)), (180, 144)) for n in near]))
    return np.vstack(rows) if rows else np.zeros((1, 1, 3), np.uint8)


if __name__ == "__main__":
    main()
