"""The pose of the head: every frame is aligned to the mean face of its clip, and mouth pictures are cut by it.

In a mouth picture the head is upright, faces the camera and has always the same size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.eigenlips import EYE_DISTANCE_PX, MOUTH_CORNER, MOUTH_HEIGHT, MOUTH_WIDTH
from lipmotion_faces.appearance.lower_face import map_region
from lipmotion_faces.tracking import trackers
from lipmotion_faces.tracking.packages import import_opencv

Array = NDArray[np.float64]

ROUNDS = 3
"""Iterations of aligning to the mean face and averaging again. On GRID the second moves points by up to 4e-6 eye
distances, the third by less than 1e-9."""
_LIPS, _RIGID = (
    [trackers.TRACKED_POINTS.index(index) for index in points]
    for points in (trackers.LIP_POINTS, trackers.RIGID_POINTS)
)


@dataclass(frozen=True, eq=False)
class HeadPose:
    """The pose of the head in every frame: point x has head coordinates (scale · rotation · x + translation) / unit."""

    rotation: Array  # [shape=(T, 3, 3)]
    scale: Array  # [shape=(T,), > 0]
    translation: Array  # [shape=(T, 3)]
    unit: float  # eye distance of the mean face

    def to_head_coordinates(self, points: Array) -> Array:
        """Return points [shape=(T, N, 3)] in head coordinates."""
        rotated = self.scale[:, None, None] * (points @ self.rotation.transpose(0, 2, 1))
        return (rotated + self.translation[:, None, :]) / self.unit


def estimate_head_pose(points: Array) -> HeadPose:
    """Return the pose of a head in every frame.

    points : ``TRACKED_POINTS`` [shape=(T, N, 3)], any unit, x to the speaker's left, y up, z out of the face
    Source: Umeyama 1991 (one frame), Gower 1975 (the mean face).
    """
    rigid = points[:, _RIGID]
    face = rigid[0] - rigid[0].mean(axis=0)
    size = np.linalg.norm(face)
    for _ in range(ROUNDS):  # generalised Procrustes analysis
        rotation, scale, translation = fit_similarities(rigid, face)
        face = (scale[:, None, None] * (rigid @ rotation.transpose(0, 2, 1)) + translation[:, None, :]).mean(axis=0)
        face *= size / np.linalg.norm(face)  # without this the mean shrinks from round to round
    rotation, scale, translation = fit_similarities(rigid, face)
    eyes = [face[trackers.RIGID_POINTS.index(index)] for index in trackers.EYE_CORNERS]
    up = face[trackers.RIGID_POINTS.index(trackers.FOREHEAD)] - face[trackers.RIGID_POINTS.index(trackers.NASION)]
    unit = float(np.linalg.norm(eyes[1] - eyes[0]))
    x, origin = (eyes[1] - eyes[0]) / unit, (eyes[0] + eyes[1]) / 2
    up = up - (up @ x) * x
    up /= np.linalg.norm(up)
    slope = np.deg2rad(trackers.FOREHEAD_SLOPE_DEG)
    y = np.cos(slope) * up + np.sin(slope) * np.cross(x, up)
    axes = np.stack([x, y, np.cross(x, y)])
    return HeadPose(axes @ rotation, scale, (translation - origin) @ axes.T, unit)


def remove_head_motion(points: Array) -> Array:
    """Return the points in head coordinates, without the motion of the head [shape=(T, N, 3)].

    points : as in ``estimate_head_pose``
    The origin lies between the outer eye corners of the mean face, the unit is their distance, x points to the
    speaker's left, y up, z out of the face. Each frame moves as a whole, which keeps the motion of speech.
    """
    return estimate_head_pose(points).to_head_coordinates(points)


def fit_similarities(points: Array, target: Array) -> tuple[Array, Array, Array]:
    """Return the rotations, scales and translations that bring each frame closest to one shape.

    points : array [shape=(T, K, 3)]
    target : array [shape=(K, 3)]
    Returns R [shape=(T, 3, 3)], s [shape=(T,), > 0], t [shape=(T, 3)]: the least squares of s·R·x + t − target.
    Source: Umeyama 1991, Eqs. 40–42 (no reflections).
    """
    mean, target_mean = points.mean(axis=1), target.mean(axis=0)
    centred, goal = points - mean[:, None, :], target - target_mean
    left, singular, right = np.linalg.svd(goal.T @ centred)
    sign = np.ones_like(singular)
    sign[:, 2] = np.sign(np.linalg.det(left @ right))
    rotation = (left * sign[:, None, :]) @ right
    scale = (singular * sign).sum(axis=1) / np.square(centred).sum(axis=(1, 2))
    translation = target_mean - scale[:, None] * (rotation @ mean[:, :, None])[:, :, 0]
    return rotation, scale, translation


def crop_mouth(image: NDArray[np.uint8], to_image: Array) -> NDArray[np.uint8]:
    """Return the mouth picture of one frame: uint8 array [shape=(56, 72, 3)].

    image    : uint8 array [shape=(H, W, 3)]
    to_image : affine map [shape=(2, 3)] of ``map_face`` or ``map_eyes``
    Pixels outside the image repeat its edge.
    """
    cv2 = import_opencv()
    shrink = max(1, int(np.sqrt(abs(np.linalg.det(to_image[:, :2]))) + 1e-9))
    crop: NDArray[np.uint8] = cv2.warpAffine(
        image,
        map_region(to_image, shrink, MOUTH_CORNER),
        (MOUTH_WIDTH * shrink, MOUTH_HEIGHT * shrink),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    if shrink > 1:  # a large face is sampled finely and averaged: no pixel of it is skipped
        crop = cv2.resize(crop, (MOUTH_WIDTH, MOUTH_HEIGHT), interpolation=cv2.INTER_AREA)
    return crop


def map_face(points: Array) -> Array:
    """Return the affine maps of every frame from the plane of the lips, without head motion, to the image.

    points : array [shape=(T, len(TRACKED_POINTS), 3)] of one person, px, x to the right, y down, z away from the camera
    Returns affine maps [shape=(T, 2, 3)] from px of the face that looks straight ahead (origin between the outer eye
    corners, these level and 90 px apart, y down) to px of the image. The plane is as far in front of the eyes as the
    lips are on average, so a nod neither moves nor shortens the mouth.
    """
    upright = points * (1, -1, -1)
    pose = estimate_head_pose(upright)
    depth = float(pose.to_head_coordinates(upright)[:, _LIPS, 2].mean())
    back = pose.rotation.transpose(0, 2, 1) / pose.scale[:, None, None]
    origin = back @ (np.array([0, 0, depth]) * pose.unit - pose.translation)[:, :, None]
    maps = np.concatenate([back[:, :2, :2] * pose.unit, origin[:, :2]], axis=2)
    maps[:, 1] *= -1  # y is down in the image,
    maps[:, :, 1] *= -1  # and in the region
    maps[:, :, :2] /= EYE_DISTANCE_PX
    return maps


def map_eyes(eyes: Array) -> Array:
    """Return the map of ``map_face`` for one frame [shape=(2, 3)], as if the face turned in its plane only.

    eyes : array [shape=(2, 2)], x and y of the right and left outer eye corner in the image, px, y down
    """
    across = (eyes[1] - eyes[0]) / EYE_DISTANCE_PX
    turn = np.array([[across[0], -across[1]], [across[1], across[0]]])
    return np.concatenate([turn, eyes.mean(axis=0)[:, None]], axis=1)
