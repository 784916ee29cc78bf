"""Poisson cloning: time and error of ``CloningSystem.clone`` beside ``cv2.seamlessClone`` and a sparse direct solver.

    python benchmarks/poisson.py [--frames 64] [--rounds 15]

One thread. Each round times every way once, so that a busy machine slows all of them; processor time is counted.
Prints a JSON object a size and mask: ms a frame (the least of the rounds), the ratio to seamlessClone (the median of
the rounds' ratios), the time that the system takes, and the largest difference from the direct solution, before
rounding, for smooth pictures, for noise of all grey levels, and for noise of black and white with the inverse picture.
OpenCV solves on the whole rectangle whatever the mask is.
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
from scipy.ndimage import gaussian_filter
from scipy.sparse import eye_array
from scipy.sparse.linalg import splu

from lipmotion_faces.appearance.poisson import CloningSystem, cloning_system

Pictures = NDArray[np.uint8]
SIZES = ((72, 56), (144, 112), (288, 224))


def main() -> None:
    """Print one JSON object a size and mask."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=64)
    parser.add_argument("--rounds", type=int, default=15)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    for width, height in SIZES:
        for name, mask in masks(height, width).items():
            print(json.dumps(figures(width, height, name, mask, options.frames, options.rounds)), flush=True)


def masks(height: int, width: int) -> dict[str, NDArray[np.bool_]]:
    """Return the masks that are compared."""
    y, x = np.mgrid[:height, :width]
    ellipse = ((x + 0.5) / width - 0.5) ** 2 + ((y + 0.5) / height - 0.5) ** 2 < 0.25
    return {"rectangle": np.ones((height, width), bool), "ellipse": ellipse}


def figures(width: int, height: int, name: str, mask: NDArray[np.bool_], frames: int, rounds: int) -> dict[str, Any]:
    """Return the figures of one size and mask."""
    system, system_s = timed(lambda: cloning_system(mask))
    draw = np.random.default_rng(0)
    smooth = [smooth_pictures(draw, frames, height, width) for _ in range(2)]
    source, background = smooth
    whole = np.full((height, width), 255, np.uint8)
    framed = np.pad(background, ((0, 0), (20, 20), (20, 20), (0, 0)))
    centre = (width // 2 + 20, height // 2 + 20)
    direct = DirectSolver(system)
    ours, opencv, sparse = [], [], []
    for _ in range(rounds):
        ours.append(timed(lambda: system.clone(source, background))[1] / frames)
        opencv.append(
            timed(lambda: [cv2.seamlessClone(source[t], framed[t], whole, centre, cv2.NORMAL_CLONE) for t in range(8)])[
                1
            ]
            / 8
        )
        sparse.append(timed(lambda: direct.clone(source[0], background[0]))[1])
    noise = [draw.integers(0, 256, (4, height, width, 3), np.uint8) for _ in range(2)]
    black = (draw.integers(0, 2, (4, height, width, 3)) * 255).astype(np.uint8)
    return {
        "size": f"{width}x{height}",
        "mask": name,
        "nodes, edge": system.response.shape,
        "system_s": round(system_s, 3),
        "ms": round(min(ours) * 1e3, 3),
        "seamlessClone_ms": round(min(opencv) * 1e3, 3),
        "ratio": round(statistics.median(b / a for a, b in zip(ours, opencv, strict=True)), 1),
        "factored_sparse_ms": round(min(sparse) * 1e3, 3),
        "error_smooth": error(system, direct, source[:4], background[:4]),
        "error_noise": error(system, direct, *noise),
        "error_black_white": error(system, direct, black, 255 - black),
    }


def smooth_pictures(draw: np.random.Generator, frames: int, height: int, width: int) -> Pictures:
    """Return pictures of blobs with all grey levels."""
    values = gaussian_filter(draw.normal(size=(4, height, width, 3)), (0, 6, 6, 0))
    values = 127 + values * 60 / values.std()
    pictures: Pictures = np.clip(values, 0, 255).astype(np.uint8)[np.arange(frames) % 4]
    return pictures


class DirectSolver:
    """The equation of every pixel, factored by SuperLU."""

    def __init__(self, system: CloningSystem) -> None:
        """Factor the system of the region."""
        height, width = system.mask.shape
        count = height * width
        matrix = 4 * eye_array(count, format="csr")
        for offset in (-width, -1, 1, width):
            matrix = matrix - eye_array(count, k=offset, format="csr")
        self.inside = np.flatnonzero(system.mask)
        self.outside = np.flatnonzero(~system.mask)
        rows = matrix[self.inside]
        self.to_outside = rows[:, self.outside]
        self.factors = splu(rows[:, self.inside].tocsc())

    def correction(self, source: Pictures, background: Pictures) -> NDArray[np.float64]:
        """Return the background minus the source, with the membrane in the region [shape=(h, w, 3)]."""
        values = (background.astype(float) - source).reshape(-1, 3)
        values[self.inside] = self.factors.solve(-(self.to_outside @ values[self.outside]))
        return values.reshape(source.shape)

    def clone(self, source: Pictures, background: Pictures) -> Pictures:
        """Return the cloned picture."""
        cloned: Pictures = np.clip(np.rint(source + self.correction(source, background)), 0, 255).astype(np.uint8)
        return cloned


def error(system: CloningSystem, direct: DirectSolver, source: Pictures, background: Pictures) -> float:
    """Return the largest difference of the membranes, grey levels."""
    ours = system.correction(source, background)
    exact = [direct.correction(*pair) for pair in zip(source, background, strict=True)]
    return round(float(np.abs(ours - exact).max()), 3)


def timed(run: Callable[[], Any]) -> tuple[Any, float]:
    """Return a result and the processor time that it took, s."""
    start = time.process_time()
    result = run()
    return result, time.process_time() - start


if __name__ == "__main__":
    main()
