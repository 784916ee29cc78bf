"""Removal of head motion: every frame is aligned to the mean face of its clip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.tracking.landmarks import EYE_CORNERS, FOREHEAD, FOREHEAD_SLOPE_DEG, NASION, RIGID_POINTS

Array = NDArray[np.float64]

ROUNDS = 3
"""Iterations of aligning to the mean face and averaging again. On GRID the second moves points by up to 4e-6 eye
distances, the third by less than 1e-9."""


@dataclass(frozen=True, eq=False)
class HeadPose:
    """The pose of the head in every frame: point x has head coordinates (scale · rotation · x + translation) / unit.

    rotation    : [shape=(T, 3, 3)]
    scale       : [shape=(T,), > 0]
    translation : [shape=(T, 3)]
    unit        : eye distance of the mean face
    """

    rotation: Array
    scale: Array
    translation: Array
    unit: float

    def to_head_coordinates(self, points: Array) -> Array:
        """Return points [shape=(T, N, 3)] in head coordinates."""
        rotated = self.scale[:, None, None] * (points @ self.rotation.transpose(0, 2, 1))
        moved: Array = (rotated + self.translation[:, None, :]) / self.unit
        return moved

    def plane_to_image(self, depth: float) -> Array:
        """Return the affine maps [shape=(T, 2, 3)] from (x, y) of the head's plane z = depth to the image."""
        back = self.rotation.transpose(0, 2, 1) / self.scale[:, None, None]
        origin = back @ (np.array([0, 0, depth]) * self.unit - self.translation)[:, :, None]
        return np.concatenate([back[:, :2, :2] * self.unit, origin[:, :2]], axis=2)


def head_pose(points: Array, layout: Sequence[int]) -> HeadPose:
    """Return the pose of a head in every frame.

    points : array [shape=(T, N, 3)], any unit, x to the speaker's left, y up, z out of the face
    layout : the face-mesh index of each of the N points; holds all of RIGID_POINTS
    Source: Umeyama 1991 (one frame), Gower 1975 (the mean face).
    Cost: O(T·N), T singular value decompositions of 3 × 3.
    """
    column = {index: n for n, index in enumerate(layout)}
    rigid = points[:, [column[index] for index in RIGID_POINTS]]
    face = _mean_face(rigid)
    rotation, scale, translation = similarity_transforms(rigid, face)
    axes, origin, unit = _head_axes(face)
    return HeadPose(axes @ rotation, scale, (translation - origin) @ axes.T, unit)


def without_head_motion(points: Array, layout: Sequence[int]) -> Array:
    """Return the points in head coordinates, without the motion of the head [shape=(T, N, 3)].

    points, layout : as in ``head_pose``
    The origin lies between the outer eye corners of the mean face, the unit is their distance, x points to the
    speaker's left, y up, z out of the face. Every frame is rotated, translated and scaled as a whole, which keeps the
    motion of speech.
    """
    return head_pose(points, layout).to_head_coordinates(points)


def similarity_transforms(points: Array, target: Array) -> tuple[Array, Array, Array]:
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


def _mean_face(rigid: Array) -> Array:
    """Return the mean of all frames' rigid points [shape=(K, 3)] after alignment (generalised Procrustes analysis)."""
    face = rigid[0] - rigid[0].mean(axis=0)
    size = np.linalg.norm(face)
    for _ in range(ROUNDS):
        rotation, scale, translation = similarity_transforms(rigid, face)
        face = (scale[:, None, None] * (rigid @ rotation.transpose(0, 2, 1)) + translation[:, None, :]).mean(axis=0)
        face *= size / np.linalg.norm(face)  # without this the mean shrinks from round to round
    return face


def _head_axes(face: Array) -> tuple[Array, Array, float]:
    """Return the head's axes as rows [shape=(3, 3)], the origin [shape=(3,)] and the unit, from its rigid points."""
    right_eye, left_eye, forehead, nasion = (
        face[RIGID_POINTS.index(index)] for index in (*EYE_CORNERS, FOREHEAD, NASION)
    )
    unit = float(np.linalg.norm(left_eye - right_eye))
    x = (left_eye - right_eye) / unit
    up = forehead - nasion - ((forehead - nasion) @ x) * x
    up /= np.linalg.norm(up)
    slope = np.deg2rad(FOREHEAD_SLOPE_DEG)
    y = np.cos(slope) * up + np.sin(slope) * np.cross(x, up)
    return np.stack([x, y, np.cross(x, y)]), (left_eye + right_eye) / 2, unit
