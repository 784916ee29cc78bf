"""Thumbnails and their correlation: whether scenes or faces are the same, and whether a mouth is occluded."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.tracking.packages import import_opencv

Image = NDArray[np.uint8]
Array = NDArray[np.float64]

CUT_LEVELS = 6.0
"""Mean change of the thumbnail between two frames, in grey levels, that begins a new scene (GRID: up to 1.3)."""
SCENE_SIZE = (32, 24)
SCENE_SAMPLES = 640  # pictures are thinned to about this number of columns or rows, whichever are more
FACE_SIZE = (36, 24)
FACE_WIDTH, FACE_TOP, FACE_BOTTOM = 0.75, 0.5, 0.5
"""The region of the upper face, which speech does not change: from the point between the eyes to either side, up and
down, in eye distances."""
MOUTH_SIZE = (18, 14)
OCCLUDED_CORRELATION = 0.2
"""A mouth is occluded when its region correlates less with the median region of the clip (in 262 clips of GRID s1, none
did)..."""
OCCLUDED_DIFFERENCE = 20.0  # ... and differs from it by more grey levels on average (GRID: up to 17 in open mouths)
NOD_ROWS = 4  # ... and correlates less at every shift by up to so many of its 14 rows than...
SHIFTED_CORRELATION = 0.5  # ... this: a nod moves the mouth in its region, which is placed by the eyes
FLAT_LEVELS = 1.0  # a region with a smaller standard deviation, in grey levels, has no texture to compare


def reduce_scene(image: Image) -> Array:
    """Return a thumbnail of the whole picture, less its mean [shape=(24, 32, 3)]; of a large one, from some pixels."""
    cv2 = import_opencv()
    step = max(1, max(image.shape[:2]) // SCENE_SAMPLES)
    small: Array = cv2.resize(image[::step, ::step], SCENE_SIZE, interpolation=cv2.INTER_AREA).astype(float)
    return small - small.mean()


def is_cut(before: Array | None, after: Array) -> bool:
    """Return whether a new scene begins between two frames, from their thumbnails; False if there is none before."""
    return before is not None and bool(np.abs(after - before).mean() > CUT_LEVELS)


def reduce_face(image: Image, eyes: Array) -> Array:
    """Return a thumbnail of the upper face, upright [shape=(24, 36, 3)]."""
    cv2 = import_opencv()
    across = eyes[1] - eyes[0]
    down, middle, (width, height) = np.array([-across[1], across[0]]), eyes.mean(axis=0), FACE_SIZE
    corner = middle - FACE_WIDTH * across - FACE_TOP * down
    columns = [2 * FACE_WIDTH * across / width, (FACE_TOP + FACE_BOTTOM) * down / height, corner]
    smooth = max(1, round(float(np.linalg.norm(columns[0]))))
    region = cv2.warpAffine(
        cv2.blur(image, (smooth, smooth)),
        np.stack(columns, axis=1),
        FACE_SIZE,
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(region, float)


def reduce_mouth(crop: Image) -> NDArray[np.uint8]:
    """Return a thumbnail of a mouth picture [shape=(14, 18, 3)]."""
    cv2 = import_opencv()
    return cv2.resize(crop, MOUTH_SIZE, interpolation=cv2.INTER_AREA)


def correlate_images(first: Array, other: Array) -> Array:
    """Return the correlation of pictures [shape=(..., H, W, 3)] less their mean colours; 0 if one has no texture."""
    a, b = (x - x.mean(axis=(-3, -2), keepdims=True) for x in (first, other))
    a_power, b_power = np.square(a).mean(axis=(-3, -2, -1)), np.square(b).mean(axis=(-3, -2, -1))
    textured = np.minimum(a_power, b_power) > FLAT_LEVELS**2
    return (a * b).mean(axis=(-3, -2, -1)) / np.where(textured, np.sqrt(a_power * b_power), np.inf)


def find_occluded_mouths(mouths: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return in which frames the mouth [shape=(T, 14, 18, 3)] is covered: unlike its median; none without texture."""
    median = np.median(mouths, axis=0)
    if np.square(median - median.mean(axis=(0, 1))).mean() < FLAT_LEVELS**2:
        return np.zeros(len(mouths), bool)
    values = mouths.astype(float)
    unlike = (correlate_images(values, median) < OCCLUDED_CORRELATION) & (
        np.abs(values - median).mean(axis=(1, 2, 3)) > OCCLUDED_DIFFERENCE
    )
    suspects, best = values[unlike], np.full(unlike.sum(), -1.0)
    for shift in range(1, NOD_ROWS + 1):
        up = correlate_images(suspects[:, :-shift], median[shift:])
        down = correlate_images(suspects[:, shift:], median[:-shift])
        best = np.maximum(best, np.maximum(up, down))
    unlike[unlike] = best < SHIFTED_CORRELATION
    return unlike
