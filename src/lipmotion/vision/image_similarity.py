"""Pictures made small enough to compare: is it still the same scene, the same face, and is its mouth in view?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.vision.packages import import_opencv

Image = NDArray[np.uint8]
Array = NDArray[np.float64]

SCENE_SIZE = (32, 24)
FACE_SIZE = (36, 24)
FACE_WIDTH, FACE_TOP, FACE_BOTTOM = 0.75, 0.5, 0.5
"""The face above the mouth, which speech leaves as it is: from the point between the eyes to either side, up and down,
in eye distances."""
MOUTH_SIZE = (18, 14)
OCCLUDED_CORRELATION = 0.2
"""A mouth region is strange when it correlates less with the clip's usual one (in 262 clips of GRID s1, none did)..."""
OCCLUDED_DIFFERENCE = 20.0
"""... and differs from it by more grey levels on average (GRID: up to 17 in open mouths)."""
FLAT_LEVELS = 1.0
"""A region that varies less has no look."""


def scene_thumbnail(image: Image) -> Array:
    """Return the whole picture, small and without its mean brightness."""
    small: Array = import_opencv().resize(image, SCENE_SIZE, interpolation=import_opencv().INTER_AREA).astype(float)
    return small - small.mean()


def face_thumbnail(image: Image, eyes: Array) -> Array:
    """Return the upper face, upright, small; ``eyes`` as in ``mouth.mouth_crop``."""
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


def mouth_thumbnail(crop: Image) -> NDArray[np.uint8]:
    """Return a mouth image, small."""
    cv2 = import_opencv()
    small: NDArray[np.uint8] = cv2.resize(crop, MOUTH_SIZE, interpolation=cv2.INTER_AREA)
    return small


def image_correlation(one: Array, other: Array) -> Array:
    """Return the correlation of pictures [shape=(..., H, W, 3)], brightness and tint aside; 0 where one is flat."""
    a, b = (x - x.mean(axis=(-3, -2), keepdims=True) for x in (one, other))
    a_power, b_power = np.square(a).mean(axis=(-3, -2, -1)), np.square(b).mean(axis=(-3, -2, -1))
    textured = np.minimum(a_power, b_power) > FLAT_LEVELS**2
    return (a * b).mean(axis=(-3, -2, -1)) / np.where(textured, np.sqrt(a_power * b_power), np.inf)


def occluded_mouths(mouths: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return where something is before the mouth: its region is nothing like the clip's usual one.

    mouths : array [shape=(T, 14, 18, 3)] of ``mouth_thumbnail``
    Returns bool array [shape=(T,)]; all False where the usual look is flat, or usual is not half of the frames.
    """
    usual = np.median(mouths, axis=0)
    if np.square(usual - usual.mean(axis=(0, 1))).mean() < FLAT_LEVELS**2:
        return np.zeros(len(mouths), bool)
    values = mouths.astype(float)
    return (image_correlation(values, usual) < OCCLUDED_CORRELATION) & (
        np.abs(values - usual).mean(axis=(1, 2, 3)) > OCCLUDED_DIFFERENCE
    )
