"""Cutting an aligned patch out of a frame and placing it back: time beside ``cv2.warpAffine``, cubic too.

    python benchmarks/resampling.py [--rounds 31]

One thread. Each round times every way once, so that a busy machine slows all of them; processor time is counted. Prints
a JSON object a size: ms (the least of the rounds) of ``cut`` and ``place``, and of OpenCV; and
the ratios OpenCV / ours (the median of the rounds' ratios). OpenCV's ``place`` is a cubic warp of the patch, a
linear one of the weight, and the blending in NumPy, in the part of the frame where the patch lies. OpenCV rounds
positions to 1/32 px and its cut to whole grey levels.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.appearance.placing import cut, feather, inverse_map, place

SIZES = (((288, 360), (112, 128)), ((720, 1280), (280, 320)), ((720, 1280), (336, 384)), ((2160, 3840), (336, 384)))
"""Frame and patch, height and width; in the last, a pixel of the patch is 2.7 pixels of the frame."""
Array = NDArray[np.float64]


def main() -> None:
    """Print one JSON object a size."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=31)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    for frame_size, size in SIZES:
        print(json.dumps(figures(frame_size, size, options.rounds)), flush=True)


def figures(frame_size: tuple[int, int], size: tuple[int, int], rounds: int) -> dict[str, Any]:
    """Return the figures of one size."""
    draw = np.random.default_rng(0)
    frame = draw.integers(0, 256, (*frame_size, 3), np.uint8)
    scale = 0.9 if frame_size[0] < 2000 else 2.7
    turn = scale * np.array([[0.995, -0.1], [0.1, 0.995]])
    middle = np.array([frame_size[1] / 2, frame_size[0] / 2])
    to_frame = np.column_stack([turn, middle - turn @ [size[1] / 2, size[0] / 2]])
    patch = np.clip(np.rint(cut(frame, to_frame, size)), 0, 255).astype(np.uint8)
    y, x = np.mgrid[: size[0], : size[1]]
    ellipse = ((x + 0.5) / size[1] - 0.5) ** 2 + ((y + 0.5) / size[0] - 0.5) ** 2 < 0.24
    weight = feather(ellipse, size[0] / 16)
    ways: dict[str, Callable[[], Any]] = {
        "cut": lambda: cut(frame, to_frame, size),
        "place": lambda: place(frame, patch, weight, to_frame),
        "opencv_cut": lambda: warped(frame, to_frame, size, cv2.INTER_CUBIC),
        "opencv_place": lambda: opencv_place(frame, patch, weight, to_frame),
    }
    times: dict[str, list[float]] = {name: [] for name in ways}
    for work in ways.values():
        work()
    for _ in range(rounds):
        for name, work in ways.items():
            start = time.process_time()
            work()
            times[name].append(time.process_time() - start)
    ratios = {
        f"ratio_{name}": round(
            statistics.median(b / a for a, b in zip(times[name], times[f"opencv_{name}"], strict=True)), 2
        )
        for name in ("cut", "place")
    }
    return {
        "frame": f"{frame_size[1]}x{frame_size[0]}",
        "patch": f"{size[1]}x{size[0]}",
        **{f"{name}_ms": round(min(values) * 1e3, 3) for name, values in times.items()},
        **ratios,
    }


def warped(picture: NDArray[Any], to_source: Array, size: tuple[int, int], kind: int) -> NDArray[Any]:
    """Return OpenCV's resampling."""
    flags = kind | cv2.WARP_INVERSE_MAP
    new: NDArray[Any] = cv2.warpAffine(
        picture, to_source, (size[1], size[0]), flags=flags, borderMode=cv2.BORDER_REPLICATE
    )
    return new


def opencv_place(
    frame: NDArray[np.uint8], patch: NDArray[np.uint8], weight: NDArray[np.float32], to_frame: Array
) -> None:
    """Blend the patch into the frame by OpenCV and NumPy."""
    height, width = weight.shape
    corners = to_frame @ np.array([[0, width, 0, width], [0, 0, height, height], [1, 1, 1, 1]])
    left, top = np.floor(corners.min(axis=1)).astype(int)
    right, bottom = np.ceil(corners.max(axis=1)).astype(int)
    to_patch = inverse_map(to_frame)
    to_patch[:, 2] += to_patch[:, :2] @ [left, top]
    size = (bottom - top, right - left)
    new = warped(patch, to_patch, size, cv2.INTER_CUBIC)
    share = warped(weight, to_patch, size, cv2.INTER_LINEAR)[..., None]
    part = frame[top:bottom, left:right]
    part[...] = np.clip(np.rint(part + share * (new - part.astype(np.float32))), 0, 255)


if __name__ == "__main__":
    main()
