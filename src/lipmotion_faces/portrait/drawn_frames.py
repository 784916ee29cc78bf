"""The frames of a motion: a pose for each, and what draws it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.mouth import spoken_mouth
from lipmotion.types import Motion, Prosody, Timeline, Unit
from lipmotion_faces.base import Picture, Staging, stage_liveliness
from lipmotion_faces.portrait.movement import HeadPlacement
from lipmotion_faces.portrait.portrait_rasteriser import FacePose
from lipmotion_faces.portrait.pose import mouth_poses

CanvasT = TypeVar("CanvasT")
RESTING_LIDS = 0.07
"""Awake and calm, the upper lids cover a little of the irises."""
LOOK, YAW, PITCH = 0.25, 0.3, 0.4
"""How far an iris moves for an angle of the eyes, and features for angles of the head, in eye distances a radian."""
SWAY_X, SWAY_Y = 0.25, 0.12
"""How far the head moves to the side and up for the same angles."""
LARGEST_TURN = np.array([0.35, 0.35, 0.13])
"""The furthest that a drawing turns to its left, upwards and to its left shoulder, in radians."""


def face_poses(
    motion: Motion, units: Timeline[Unit], fps: float, staging: Staging, prosody: Prosody | None = None
) -> list[FacePose]:
    """Return the pose of every video frame, frame n at ``n / fps`` seconds. Raises InputError: as ``spoken_mouth``."""
    mouth = spoken_mouth(motion, units, fps)
    moved = stage_liveliness(np.arange(len(mouth.gap)) / fps, motion, units, staging, prosody)
    gaze = LOOK * moved.gaze
    yaw, pitch, roll = np.clip(moved.turn, -LARGEST_TURN, LARGEST_TURN).T
    heads = np.stack([SWAY_X * yaw, -SWAY_Y * pitch, roll, YAW * yaw, -PITCH * pitch], axis=1)
    lids = np.maximum(moved.lids, RESTING_LIDS)
    return [
        FacePose(pose, shut, look[0], -look[1], brows, HeadPlacement(*head), mood)
        for pose, shut, look, brows, head, mood in zip(
            mouth_poses(mouth.with_corners(moved.unit(12), moved.unit(15))),
            lids.tolist(),
            gaze.tolist(),
            moved.brows.tolist(),
            heads.tolist(),
            moved.upper_face,
            strict=True,
        )
    ]


class Draws(Protocol[CanvasT]):
    """What draws the pictures of poses, each thread on a canvas of its own."""

    def canvas(self) -> CanvasT:
        """Return what ``picture`` draws on."""

    def picture(self, pose: FacePose, canvas: CanvasT) -> NDArray[np.uint8]:
        """Return one frame."""


def painter(drawing: Draws[CanvasT]) -> Callable[[FacePose], Picture]:
    """Return what draws the picture of a pose, on a canvas of the thread that calls it."""
    canvases = threading.local()

    def painted(pose: FacePose) -> Picture:
        if not hasattr(canvases, "own"):
            canvases.own = drawing.canvas()
        return drawing.picture(pose, canvases.own)

    return painted
