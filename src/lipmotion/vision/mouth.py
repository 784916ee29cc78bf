"""The mouth cut out of a frame, head upright and always the same size."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.vision.packages import import_opencv

WIDTH, HEIGHT = 72, 56
CORNER = (-36.0, 48.0)
"""Upper left corner of the region, in px from the point between the eyes, y down."""
EYE_DISTANCE_PX = 90.0


def mouth_crop(image: NDArray[np.uint8], eyes: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return the mouth region of one frame.

    image : uint8 array [shape=(H, W, 3)]
    eyes  : array [shape=(2, 2)], x and y of the right and left outer eye corner in the image, px, y down
    Returns uint8 array [shape=(56, 72, 3)]: the eye corners would be level and 90 px apart. What lies outside the
    image repeats its edge.
    """
    cv2 = import_opencv()
    shrink = max(1, int(np.linalg.norm(eyes[1] - eyes[0]) // EYE_DISTANCE_PX))
    crop: NDArray[np.uint8] = cv2.warpAffine(
        image,
        region_to_image(eyes, shrink),
        (WIDTH * shrink, HEIGHT * shrink),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    if shrink > 1:  # a large face is sampled finely and averaged: no pixel of it is skipped
        crop = cv2.resize(crop, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return crop


def region_to_image(eyes: NDArray[np.float64], samples: int = 1) -> NDArray[np.float64]:
    """Return the affine map from a pixel of the region to its place in the image [shape=(2, 3)].

    eyes    : as in ``mouth_crop``
    samples : pixels per pixel of the region, along each side
    Pixel (0, 0) is a centre, as OpenCV counts; its upper left corner lies at ``CORNER``.
    """
    across = (eyes[1] - eyes[0]) / EYE_DISTANCE_PX
    turn = np.array([[across[0], -across[1]], [across[1], across[0]]])
    first = np.array(CORNER) + 0.5 / samples
    between = eyes.mean(axis=0) - 0.5
    return np.concatenate([turn / samples, (between + turn @ first)[:, None]], axis=1)
