"""A mouth of one recorded frame in another frame of the same speaker: seams, sharpness, what shines through.

    python benchmarks/placing.py [--corpora ../shared/corpora] [--pairs 12] [--sheet FILE.png]

Frames of three clips of ``val``. Prints a JSON object a way of placing, means over the pairs:
seam      : gradient across the outline of the mask, relative to the same pixels of the frame as it was recorded
sharpness : gradient energy of the mouth, relative to that of the source in its own frame
residual  : root mean square difference of the placed mouth, aligned again, from the cloned one, grey levels
and the largest error of the membranes of these mouths. ``--sheet``: the pictures (source, frame, ways) to look at.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from poisson import DirectSolver, error
from scipy.ndimage import binary_erosion, distance_transform_edt

from lipmotion.motion.mouth_region import HEIGHT, WIDTH
from lipmotion_faces.appearance.placing import feather, inverse_map, place
from lipmotion_faces.appearance.poisson import cloning_system
from lipmotion_faces.kernels.affine import resample
from lipmotion_faces.tracking.face_follower import FaceFollower
from lipmotion_faces.tracking.frames import open_video
from lipmotion_faces.tracking.mouth_pictures import face_to_image, region_to_image

Picture = NDArray[np.uint8]
FEATHER_PX = 6.0


def main() -> None:
    """Print one JSON object a way."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpora", type=Path, default=Path("../shared/corpora"))
    parser.add_argument("--pairs", type=int, default=12)
    parser.add_argument("--sheet", type=Path)
    options = parser.parse_args()
    grid = options.corpora / "grid-s1"
    clips = [followed(grid / "clips" / f"{name}.mkv") for name in (grid / "val.txt").read_text().split()[:3]]
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    system = cloning_system(((x - 35.5) / 35) ** 2 + ((y - 27.5) / 27) ** 2 < 1)
    direct = DirectSolver(system)
    soft, hard = feather(system.mask, FEATHER_PX), system.mask.astype(np.float32)
    draw = np.random.default_rng(0)
    results: dict[str, list[tuple[float, ...]]] = {}
    errors, rows = [], []
    for _ in range(options.pairs):
        (frame_a, map_a), (frame_b, map_b) = (one(clips[n], draw) for n in draw.integers(0, len(clips), 2))
        own = outline(system.mask, map_a, frame_a)
        inside = outline(system.mask, map_b, frame_b)
        seam = (distance_transform_edt(~inside) <= 1.5) & (distance_transform_edt(inside) <= 1.5)
        core = binary_erosion(system.mask, iterations=8)
        row = [crop(frame_a, map_a), crop(frame_b, map_b)]
        source, background = aligned(frame_a, map_a), aligned(frame_b, map_b)
        clone = system.clone(source[None], background[None])[0]
        errors.append(error(system, direct, source[None], background[None]))
        ways = {
            "cloned, blended": (clone, soft),
            "correction added": (clone.astype(np.float32) - background, soft),
            "cloned, hard edge": (clone, hard),
            "pasted, blended": (source, soft),
            "pasted, hard edge": (source, hard),
        }
        for way, (patch, weight) in ways.items():
            placed = frame_b.copy()
            if way == "correction added":
                add(placed, patch, weight, map_b)
            else:
                place(placed, patch, weight, map_b)
            again = aligned(placed, map_b).astype(float) - clone
            results.setdefault(way, []).append(
                (
                    slope(placed)[seam].mean() / slope(frame_b)[seam].mean(),
                    np.square(slope(placed)[binary_erosion(inside, iterations=6)]).mean()
                    / np.square(slope(frame_a)[binary_erosion(own, iterations=6)]).mean(),
                    np.sqrt(np.square(again[core]).mean()),
                )
            )
            row.append(crop(placed, map_b))
        rows.append(np.hstack(row))
    for way, values in results.items():
        means = np.mean(values, axis=0)
        print(json.dumps({"way": way, **dict(zip(("seam", "sharpness", "residual"), means.round(3), strict=True))}))
    print(json.dumps({"pairs": options.pairs, "largest error of the membranes": max(errors)}))
    if options.sheet:
        cv2.imwrite(str(options.sheet), np.vstack(rows)[:, :, ::-1])


def followed(path: Path) -> list[tuple[Picture, NDArray[np.float64]]]:
    """Return the frames that show a face, each with the map from the mouth region."""
    images, points = [], []
    with open_video(path) as video, FaceFollower() as follower:
        for frame in video.frames:
            found = follower.points(frame.image)
            if found is not None:
                images.append(frame.image)
                points.append(found)
    return [(image, region_to_image(one)) for image, one in zip(images, face_to_image(np.stack(points)), strict=True)]


def one(
    clip: list[tuple[Picture, NDArray[np.float64]]], draw: np.random.Generator
) -> tuple[Picture, NDArray[np.float64]]:
    """Return a frame of a clip, at random."""
    return clip[int(draw.integers(len(clip)))]


def aligned(frame: Picture, to_frame: NDArray[np.float64]) -> Picture:
    """Return the mouth region of a frame."""
    region = resample(frame[None], to_frame, (HEIGHT, WIDTH))[0]
    rounded: Picture = np.clip(np.rint(region), 0, 255).astype(np.uint8)
    return rounded


def add(
    frame: Picture, change: NDArray[np.float32], weight: NDArray[np.float32], to_frame: NDArray[np.float64]
) -> None:
    """Add an aligned change to a frame, instead of blending a patch into it."""
    rows = resample(change[None], inverse_map(to_frame), frame.shape[:2])[0]
    frame[...] = np.clip(np.rint(frame + in_frame(weight, to_frame, frame)[..., None] * rows), 0, 255)


def in_frame(values: NDArray[np.float32], to_frame: NDArray[np.float64], frame: Picture) -> NDArray[np.float32]:
    """Return aligned values at the pixels of the frame, interpolated linearly."""
    size, flags = frame.shape[1::-1], cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    new: NDArray[np.float32] = cv2.warpAffine(values, inverse_map(to_frame), size, flags=flags)
    return new


def outline(mask: NDArray[np.bool_], to_frame: NDArray[np.float64], frame: Picture) -> NDArray[np.bool_]:
    """Return the mask in the frame."""
    return in_frame(mask.astype(np.float32), to_frame, frame) > 0.5


def slope(frame: Picture) -> NDArray[np.float64]:
    """Return the size of the gradient, mean of the colours, at each pixel."""
    down, across = (
        np.abs(np.diff(frame.astype(float), axis=axis, append=frame.take([-1], axis))).mean(axis=2) for axis in (0, 1)
    )
    return np.hypot(down, across)


def crop(frame: Picture, to_frame: NDArray[np.float64]) -> Picture:
    """Return the lower half of the face, twice as large."""
    x, y = (to_frame @ [WIDTH / 2, HEIGHT / 2, 1]).astype(int)
    part = np.pad(frame, ((60, 60), (60, 60), (0, 0)), mode="edge")[y + 15 : y + 105, x + 5 : x + 115]
    large: Picture = cv2.resize(part, (220, 180), interpolation=cv2.INTER_CUBIC)
    return large


if __name__ == "__main__":
    main()
