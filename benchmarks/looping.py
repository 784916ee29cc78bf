"""Joins of a background that is shown longer than it is: how much larger the steps there are than ordinary ones.

    python benchmarks/looping.py [--corpora ../shared/corpora] [--clips 4] [--seconds 120] [--sheet FOLDER]
        [--face FILE.face ...] [VIDEO ...]

Prints a JSON object a video, or the background of a face: its joins, their costs, and mean absolute differences of the
frames shown at joins in all pixels, relative to the median of neighbours; ``ordinary`` is the largest of neighbours
that are no join. ``new in 10 s``: how many seconds of footage are seen in ten seconds, mean; ``seen again after``: the
median time after which a frame is shown again, s. ``--sheet``: eight frames around some joins of each video, to look
at.
"""

from __future__ import annotations

import argparse
import json
from functools import partial
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.appearance.looping import LoopOrder, fade_frames
from lipmotion_faces.film.background import BackgroundSequence, chin_px, placed_maps, stored_sequence
from lipmotion_faces.filmed.face import load_face
from lipmotion_faces.tracking.footage import footage_groups, track_footage
from lipmotion_faces.tracking.frames import VideoSpan

LONGEST = VideoSpan(0, 20)
WINDOW_S = 10
Frames = list[NDArray[np.uint8]]


def main() -> None:
    """Print one JSON object a background."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpora", type=Path, default=Path("../shared/corpora"))
    parser.add_argument("--clips", type=int, default=4)
    parser.add_argument("--seconds", type=float, default=120)
    parser.add_argument("--sheet", type=Path)
    parser.add_argument("--face", type=Path, action="append", default=[])
    parser.add_argument("videos", nargs="*", type=Path)
    options = parser.parse_args()
    grid = options.corpora / "grid-s1"
    names = (grid / "val.txt").read_text().split()[: options.clips] if options.clips else []
    videos = (*(grid / "clips" / f"{name}.mkv" for name in names), *options.videos)
    backgrounds = {path.stem: filmed(path) for path in videos}
    backgrounds |= {path.stem: stored_sequence(load_face(path).background) for path in options.face}
    for name, sequence in backgrounds.items():
        count = round(options.seconds * sequence.rate_hz)
        order = sequence.order(sequence.groups(), count)
        frames = [each.frame for each in sequence.frames(count, sequence.rate_hz)]
        values = figures(sequence, frames, order)
        print(json.dumps({"video": name, "frames": len(sequence.chin_px), **values}), flush=True)
        if options.sheet:
            cv2.imwrite(str(options.sheet / f"{name}.png"), sheet(frames, order)[:, :, ::-1])


def filmed(path: Path) -> BackgroundSequence:
    """Return the beginning of a video as a background."""
    footage = track_footage(path, LONGEST)
    groups, maps = partial(footage_groups, footage), placed_maps(footage)
    return BackgroundSequence(groups, footage.rate_hz, maps, chin_px(footage), footage.track.seen, footage.cuts)


def figures(sequence: BackgroundSequence, frames: Frames, order: LoopOrder) -> dict[str, float]:
    """Return the figures of one order, whose frames are given as they are shown."""
    fade = fade_frames(sequence.rate_hz)
    steps = np.array([difference(first, other) for first, other in pairwise(frames)])
    reach = {"turn": 1, "jump": fade // 2 + 1}
    at = {
        kind: {n for join in order.joins if join.kind == kind for n in range(join.at - near, join.at + near)}
        for kind, near in reach.items()
    }
    ordinary = np.delete(steps, [n - 1 for n in at["turn"] | at["jump"] if 0 < n <= len(steps)])
    usual = float(np.median(ordinary))
    found: dict[str, float] = {"ordinary": round(ordinary.max() / usual, 2)}
    for kind, near in at.items():
        joins = [join for join in order.joins if join.kind == kind]
        found[f"{kind}s"] = len(joins)
        if joins:
            found[f"{kind} cost"] = round(max(join.cost for join in joins), 2)
            found[f"{kind} step"] = round(max(steps[n - 1] for n in near if 0 < n <= len(steps)) / usual, 2)
    window = round(WINDOW_S * sequence.rate_hz)
    starts = range(0, max(1, len(order) - window), round(sequence.rate_hz))
    new = np.mean([len(set(order.first[n : n + window].tolist())) for n in starts]) / sequence.rate_hz
    shown = np.lexsort((np.arange(len(order)), order.first))
    after = np.diff(shown)[np.diff(order.first[shown]) == 0]
    return found | {
        "new in 10 s": round(float(new), 1),
        "seen again after": round(float(np.median(after)) / sequence.rate_hz, 1) if len(after) else float("inf"),
    }


def difference(first: NDArray[np.uint8], other: NDArray[np.uint8]) -> float:
    """Return the mean absolute difference of two frames."""
    return float(np.abs(first.astype(np.int16) - other).mean())


def sheet(frames: Frames, order: LoopOrder) -> NDArray[np.uint8]:
    """Return the frames around up to four turns and four jumps, a row each."""
    rows = []
    for kind in ("turn", "jump"):
        for join in [join for join in order.joins if join.kind == kind][:4]:
            near = np.clip(np.arange(join.at - 8, join.at + 8, 2), 0, len(order) - 1)
            rows.append(np.hstack([cv2.resize(frames[int(n)], (180, 144)) for n in near]))
    return np.vstack(rows) if rows else np.zeros((1, 1, 3), np.uint8)


if __name__ == "__main__":
    main()
