"""Face pictures as SyncNet was trained on them: the lower face in the middle, upright as in the video."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lipmotion.vision.footage import Footage, footage_frames
from lipmotion.vision.packages import import_opencv

Array = NDArray[np.float64]

MIDDLE_PX, HALF_PX = 33.0, 89.0
"""The middle of a face from forehead to chin (points 10 and 152 of the face mesh), below the eyes, and half of its
height, px of the face that looks straight ahead."""
MARGIN = 0.4
"""A picture reaches so many halves of the face beyond its sides, and twice that below it."""
STEADY_PICTURES = 13
"""Place and size are medians over so many pictures."""
GREY = 110
"""What is beyond the frame, as in the published program."""


def face_pictures(footage: Footage, rate_hz: float, side_px: int) -> Iterator[NDArray[np.uint8]]:
    """Yield the face in a tracked video at a constant rate: uint8 arrays [shape=(side_px, side_px, 3)], blue first.

    Source: the crop of the published program of Chung & Zisserman 2016, with one deviation: it measures the face by the
    box of a detector (S3FD), we by the points of the tracker, from forehead to chin.
    """
    cv2 = import_opencv()
    count = int((len(footage) - 1) / footage.rate_hz * rate_hz + 1e-6) + 1
    wanted = np.floor(np.arange(count) * footage.rate_hz / rate_hz + 0.5).astype(int)
    maps = iter(_to_frame(footage.face_to_image[wanted], side_px))
    repeated = np.bincount(wanted, minlength=len(footage))
    for frame, times in zip(footage_frames(footage), repeated, strict=True):
        for _ in range(times):
            picture = cv2.warpAffine(
                frame,
                next(maps),
                (side_px, side_px),
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_CONSTANT,
                borderValue=(GREY, GREY, GREY),
            )
            yield picture[:, :, ::-1]


def _to_frame(face_to_image: Array, side_px: int) -> Array:
    """Return the affine maps from pixels of the pictures to pixels of the frame [shape=(T, 2, 3)]."""
    from scipy.ndimage import median_filter

    turn = face_to_image[:, :, :2]
    half = HALF_PX * np.sqrt(np.abs(np.linalg.det(turn)))
    middle = turn @ (0.0, MIDDLE_PX) + face_to_image[:, :, 2]
    steady = median_filter(np.column_stack([middle, half]), (STEADY_PICTURES, 1), mode="nearest")
    half = steady[:, 2]
    corner = steady[:, :2] - half[:, None] * (1 + MARGIN, 1)
    scale = 2 * (1 + MARGIN) * half / side_px
    maps = np.zeros((len(half), 2, 3))
    maps[:, 0, 0] = maps[:, 1, 1] = scale
    maps[:, :, 2] = corner + scale[:, None] / 2 - 0.5
    return maps
