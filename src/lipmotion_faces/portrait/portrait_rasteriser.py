"""Poses of a motion, and their pictures. The portrait is painted once; for each frame only what moves is painted."""

from __future__ import annotations

import threading
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.liveliness import CALM, UpperFace
from lipmotion.articulation.mouth import spoken_mouth
from lipmotion.types import Motion, Prosody, Timeline, Unit
from lipmotion_faces.base import SCENE, Picture, Staging, stage_liveliness
from lipmotion_faces.kernels.painting import stack, warp, warp_bytes
from lipmotion_faces.portrait import geometry
from lipmotion_faces.portrait.design import Colour, Design
from lipmotion_faces.portrait.layer import View, Window
from lipmotion_faces.portrait.mouth_painting import MouthPainter
from lipmotion_faces.portrait.parts import EyePainter, paint_still_layers

Pixels = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Canvas = NDArray[np.uint16]
RESTING_LIDS = 0.07
"""Awake and calm, the upper lids cover a little of the irises."""
LOOK, YAW, PITCH = 0.25, 0.3, 0.4
"""How far an iris moves for an angle of the eyes, and features for angles of the head, in eye distances a radian."""
SWAY_X, SWAY_Y = 0.25, 0.12
"""How far the head moves to the side and up for the same angles."""
LARGEST_TURN = np.array([0.35, 0.35, 0.13])
"""The furthest that a drawing turns to its left, upwards and to its left shoulder, in radians."""


class FacePose(NamedTuple):
    """Everything that moves in a frame; lengths in eye distances, gaze to the right and down, lids closed 0..1."""

    mouth: geometry.MouthPose
    lids: float = 0.0
    gaze_x: float = 0.0
    gaze_y: float = 0.0
    brows: float = 0.0
    head: geometry.HeadPlacement = geometry.HeadPlacement()
    mood: UpperFace = CALM


def face_poses(
    motion: Motion, units: Timeline[Unit], fps: float, staging: Staging, prosody: Prosody | None = None
) -> list[FacePose]:
    """Return the pose of every video frame, frame n at ``n / fps`` seconds. Raises InputError: as ``spoken_mouth``."""
    mouth = spoken_mouth(motion, units, fps)
    moved = stage_liveliness(np.arange(len(mouth.gap)) / fps, motion, units, staging, prosody)
    gaze = LOOK * moved.gaze
    yaw, pitch, roll = np.clip(moved.turn, -LARGEST_TURN, LARGEST_TURN).T
    heads = np.stack([SWAY_X * yaw, -SWAY_Y * pitch, roll, YAW * yaw, -PITCH * pitch], axis=1)
    lids, rows = np.maximum(moved.lids, RESTING_LIDS), mouth.with_corners(moved.unit(12), moved.unit(15)).rows()
    return [
        FacePose(
            geometry.MouthPose(*(row[name] for name in geometry.MouthPose._fields)),
            shut,
            x,
            -y,
            brows,
            geometry.HeadPlacement(*head),
            mood,
        )
        for row, shut, (x, y), brows, head, mood in zip(
            rows, lids.tolist(), gaze.tolist(), moved.brows.tolist(), heads.tolist(), moved.upper_face, strict=True
        )
    ]


class Rasteriser:
    """Draws a character at one size; ``paint`` may be called by several threads, each of which has its own canvas."""

    def __init__(self, design: Design, size: int, background: Colour | str | None = SCENE) -> None:
        view, line_y = View(size), design.lips.line_y
        whole = view.window(-9, -9, 9, 9)
        self._opaque, self._canvases = background is not None, threading.local()
        self._jaw = view.window(-0.86, line_y - 0.5, 0.86, line_y + 0.95)
        self._mouth = view.window(-0.56, line_y - 0.24, 0.56, line_y + 0.7)
        self._eyes, self._brow = view.window(-0.66, -0.24, 0.66, 0.21), view.window(-0.8, -0.64, 0.8, -0.06)
        # the part of the eyes' window that the brows' does not have
        self._below_brows = Window(view, self._eyes.x0, self._brow.y1, self._eyes.x1, self._eyes.y1)
        self._head = view.window(-1.3, -9, 1.3, 1.9)
        self._skin, self._below, self._shade, self._front, still = paint_still_layers(whole, design, background)
        self._eye_painter = EyePainter(design, self._eyes)
        self._still = (still * (1, 1, 1, 255) + 0.5).astype(np.uint16)
        self._frame = self._still[..., : 3 if self._opaque else 4].astype(np.uint8)
        self._brows = lru_cache(maxsize=64)(self._paint_brows)
        self._skin_field, self._brow_field = geometry.SkinField(self._jaw, design.lips), geometry.BrowField(self._brow)
        self._head_field = geometry.HeadField(self._head)
        self._mouth_painter = MouthPainter(design, self._mouth)

    def canvas(self) -> Canvas:
        """Return the picture of the resting face without eyes and mouth, to draw on [shape=(size, size, 4)]."""
        return self._still.copy()

    def paint(self, pose: FacePose) -> Picture:
        """Return one frame, drawn on the canvas of the thread that calls; shape as of ``picture``."""
        if not hasattr(self._canvases, "own"):
            self._canvases.own = self.canvas()
        return self.picture(pose, self._canvases.own)

    def picture(self, pose: FacePose, canvas: Canvas) -> Bytes:
        """Return one frame [shape=(size, size, 3), or 4 channels where transparent]; the canvas is changed."""
        skin = self._move_skin(self._jaw, self._skin_field.shifts(pose.mouth, pose.mood))
        self._mouth_painter.paint(skin[self._mouth.area_in(self._jaw)][..., :4], pose.mouth)
        self._lay(skin, self._jaw, canvas[self._jaw.area])
        canvas[self._brow.area] = self._brows(geometry.brow_pose(pose.brows, pose.mood, self._brow.view.scale))
        canvas[self._below_brows.area] = self._still[self._below_brows.area]
        eyes = self._eye_painter.paint(pose.lids, pose.gaze_x, pose.gaze_y, pose.mood)
        mixed = eyes * np.array([1, 1, 1, 255], np.float32)
        mixed += (1 - eyes[..., 3:]) * canvas[self._eyes.area]
        mixed += np.float32(0.5)
        canvas[self._eyes.area] = mixed
        frame = self._frame.copy()
        area = self._head.area
        warp_bytes(canvas[area], *self._head_field.shifts(pose.head), geometry.STEP, frame[area])
        if not self._opaque:  # straight alpha, as files store it
            cover = frame[..., 3:].astype(np.uint16)
            edge = (cover[..., 0] > 0) & (cover[..., 0] < 255)
            colours = (frame[edge, :3].astype(np.uint16) * 255 + cover[edge] // 2) // cover[edge]
            frame[edge, :3] = np.minimum(colours, 255)
        return frame

    def _paint_brows(self, brows: geometry.BrowPose) -> Canvas:
        picture = np.empty_like(self._still[self._brow.area])
        self._lay(self._move_skin(self._brow, self._brow_field.shifts(brows)), self._brow, picture)
        return picture

    def _move_skin(self, window: Window, shifts: tuple[NDArray[np.float64], NDArray[np.float64]]) -> Pixels:
        source = self._skin[window.area]
        skin = np.empty_like(source)
        warp(source, *shifts, geometry.STEP, skin)
        return skin

    def _lay(self, skin: Pixels, window: Window, target: Canvas) -> None:
        area = window.area
        stack(self._below[area], self._shade[area], skin, self._front[area], target)
