"""Mouth pictures: the mouth region of a frame, with the head upright, facing the camera and always of the same size."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.mouth_region import CORNER, EYE_DISTANCE_PX, HEIGHT, WIDTH
from lipmotion_faces.tracking.head_pose import head_pose
from lipmotion_faces.tracking.landmarks import LIP_POINTS, TRACKED_POINTS
from lipmotion_faces.tracking.packages import import_opencv

Array = NDArray[np.float64]

_LIPS = [TRACKED_POINTS.index(index) for index in LIP_POINTS]


def mouth_crop(image: NDArray[np.uint8], to_image: Array) -> NDArray[np.uint8]:
    """Return the mouth picture of one frame: uint8 array [shape=(56, 72, 3)].

    image    : uint8 array [shape=(H, W, 3)]
    to_image : affine map [shape=(2, 3)] of ``face_to_image`` or ``eyes_to_image``
    Pixels outside the image repeat its edge.
    """
    cv2 = import_opencv()
    shrink = max(1, int(np.sqrt(abs(np.linalg.det(to_image[:, :2]))) + 1e-9))
    crop: NDArray[np.uint8] = cv2.warpAffine(
        image,
        region_to_image(to_image, shrink),
        (WIDTH * shrink, HEIGHT * shrink),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    if shrink > 1:  # a large face is sampled finely and averaged: no pixel of it is skipped
        crop = cv2.resize(crop, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return crop


def region_to_image(to_image: Array, samples: int = 1) -> Array:
    """Return the affine map from a pixel of the mouth region to its position in the image [shape=(2, 3)].

    to_image : as in ``mouth_crop``
    samples  : pixels per pixel of the region, along each side
    Pixel (0, 0) is a centre, as OpenCV counts; its upper left corner lies at ``CORNER``.
    """
    turn = to_image[:, :2]
    first = np.array(CORNER) + 0.5 / samples
    return np.concatenate([turn / samples, (to_image[:, 2] - 0.5 + turn @ first)[:, None]], axis=1)


def face_to_image(points: Array) -> Array:
    """Return the affine maps of every frame from the plane of the lips, without head motion, to the image.

    points : array [shape=(T, len(TRACKED_POINTS), 3)] of one person, px, x to the right, y down, z away from the camera
    Returns affine maps [shape=(T, 2, 3)] from px of the face that looks straight ahead (origin between the outer eye
    corners, these level and 90 px apart, y down) to px of the image. The plane is as far in front of the eyes as the
    lips are on average, so a nod neither moves nor shortens the mouth.
    """
    upright = points * (1, -1, -1)
    pose = head_pose(upright, TRACKED_POINTS)
    maps = pose.plane_to_image(float(pose.to_head_coordinates(upright)[:, _LIPS, 2].mean()))
    maps[:, 1] *= -1  # y is down in the image,
    maps[:, :, 1] *= -1  # and in the region
    maps[:, :, :2] /= EYE_DISTANCE_PX
    return maps


def eyes_to_image(eyes: Array) -> Array:
    """Return the affine map of ``face_to_image`` for one frame [shape=(2, 3)], as if the face turned in its plane only.

    eyes : array [shape=(2, 2)], x and y of the right and left outer eye corner in the image, px, y down
    """
    across = (eyes[1] - eyes[0]) / EYE_DISTANCE_PX
    turn = np.array([[across[0], -across[1]], [across[1], across[0]]])
    return np.concatenate([turn, eyes.mean(axis=0)[:, None]], axis=1)
