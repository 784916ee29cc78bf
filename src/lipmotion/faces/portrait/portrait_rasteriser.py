"""Pictures of poses. The portrait is painted once; for each frame only what moves is painted again."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.liveliness import CALM, UpperFace
from lipmotion.faces.portrait import surroundings
from lipmotion.faces.portrait.design import Design
from lipmotion.faces.portrait.eyes import EyePainter
from lipmotion.faces.portrait.head import paint_head
from lipmotion.faces.portrait.layer import Layer
from lipmotion.faces.portrait.mouth_painting import MouthPainter
from lipmotion.faces.portrait.movement import STEP, BrowField, BrowPose, HeadField, HeadPlacement, SkinField, brow_pose
from lipmotion.faces.portrait.palette import Colour
from lipmotion.faces.portrait.pose import MouthPose
from lipmotion.faces.portrait.view import View, Window
from lipmotion.kernels.pixels.painting import stack, warp, warp_bytes

Pixels = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Canvas = NDArray[np.uint16]
SCENE = "scene"


class FacePose(NamedTuple):
    """Everything that moves, in one frame.

    lids           : how far the eyes are closed, 0..1
    gaze_x, gaze_y : how far the irises are to the right and down, in eye distances
    brows          : how far the brows are raised, in eye distances
    mood           : what a mood does beside the mouth
    """

    mouth: MouthPose
    lids: float = 0.0
    gaze_x: float = 0.0
    gaze_y: float = 0.0
    brows: float = 0.0
    head: HeadPlacement = HeadPlacement()
    mood: UpperFace = CALM


class Rasteriser:
    """Draws a character at one size; ``picture`` may be called by several threads, each with a canvas of its own.

    background : ``scene`` (the character's own), a colour, or None (transparent)
    """

    def __init__(self, design: Design, size: int, background: Colour | str | None = SCENE) -> None:
        view = View(size)
        whole = view.window(-9, -9, 9, 9)
        self._opaque = background is not None
        self._jaw, self._mouth, self._eyes, self._brow, self._below_brows, self._head = moving_parts(view, design)
        self._skin, self._below, self._shade, self._front, still = still_layers(whole, design, background)
        self._eye_painter = EyePainter(design, self._eyes)
        self._still = (still * (1, 1, 1, 255) + 0.5).astype(np.uint16)
        self._frame = self._still[..., : 3 if self._opaque else 4].astype(np.uint8)
        self._brows = lru_cache(maxsize=64)(self._painted_brows)
        self._skin_field, self._brow_field = SkinField(self._jaw, design.lips), BrowField(self._brow)
        self._head_field = HeadField(self._head)
        self._mouth_painter = MouthPainter(design, self._mouth)

    def canvas(self) -> Canvas:
        """Return the picture of the resting face without eyes and mouth, to draw on [shape=(size, size, 4)]."""
        return self._still.copy()

    def picture(self, pose: FacePose, canvas: Canvas) -> Bytes:
        """Return one frame [shape=(size, size, 3)], or where the background is transparent [shape=(size, size, 4)].

        canvas : from ``canvas``; changed
        """
        skin = self._moved(self._jaw, self._skin_field.shifts(pose.mouth, pose.mood))
        self._mouth_painter.paint(skin[self._mouth.area_in(self._jaw)][..., :4], pose.mouth)
        self._lay(skin, self._jaw, canvas[self._jaw.area])
        canvas[self._brow.area] = self._brows(brow_pose(pose.brows, pose.mood, self._brow.view.scale))
        canvas[self._below_brows.area] = self._still[self._below_brows.area]
        _put(self._eye_painter.painted(pose.lids, pose.gaze_x, pose.gaze_y, pose.mood), canvas[self._eyes.area])
        frame = self._frame.copy()
        area = self._head.area
        warp_bytes(canvas[area], *self._head_field.shifts(pose.head), STEP, frame[area])
        return frame if self._opaque else _straight(frame)

    def _painted_brows(self, brows: BrowPose) -> Canvas:
        picture = np.empty_like(self._still[self._brow.area])
        self._lay(self._moved(self._brow, self._brow_field.shifts(brows)), self._brow, picture)
        return picture

    def _moved(self, window: Window, shifts: tuple[NDArray[np.float64], NDArray[np.float64]]) -> Pixels:
        source = self._skin[window.area]
        skin = np.empty_like(source)
        warp(source, *shifts, STEP, skin)
        return skin

    def _lay(self, skin: Pixels, window: Window, target: Canvas) -> None:
        area = window.area
        stack(self._below[area], self._shade[area], skin, self._front[area], target)


class MovingParts(NamedTuple):
    """Windows of what moves; ``below_brows`` is the part of the eyes' window that the brows' does not have."""

    jaw: Window
    mouth: Window
    eyes: Window
    brow: Window
    below_brows: Window
    head: Window


def moving_parts(view: View, design: Design) -> MovingParts:
    """Return the windows of what moves in a view of a character."""
    line_y = design.lips.line_y
    eyes, brow = view.window(-0.66, -0.24, 0.66, 0.21), view.window(-0.8, -0.64, 0.8, -0.06)
    return MovingParts(
        jaw=view.window(-0.86, line_y - 0.5, 0.86, line_y + 0.95),
        mouth=view.window(-0.56, line_y - 0.24, 0.56, line_y + 0.7),
        eyes=eyes,
        brow=brow,
        below_brows=Window(view, eyes.x0, brow.y1, eyes.x1, eyes.y1),
        head=view.window(-1.3, -9, 1.3, 1.9),
    )


class PaintedLayers(NamedTuple):
    """What is painted once: premultiplied colour 0..255, and cover 0..1 [shape=(h, w, 4)].

    skin  : of the head, with the strength of its shadow on what is behind it as one more channel [shape=(h, w, 5)]
    below : what is behind it
    shade : is added to that where the shadow falls
    front : what is in front of it
    still : all of them over one another, at rest
    """

    skin: Pixels
    below: Pixels
    shade: Pixels
    front: Pixels
    still: Pixels


def still_layers(whole: Window, design: Design, background: Colour | str | None) -> PaintedLayers:
    """Return the layers of a character without eyes and mouth."""
    behind, skin = surroundings.behind_head(whole, design), paint_head(whole, design).pixels
    front = surroundings.hair(whole, design).pixels
    below = _over(behind.pixels, _backdrop(whole, design, background))
    shade = _over(surroundings.shaded_neck(whole, design).pixels, below) - below
    shadow = surroundings.chin_shadow(whole, design)
    still = _over(front, _over(skin, below + shadow[..., None] * shade))
    return PaintedLayers(np.dstack([skin, shadow]), below, shade, front, still)


_WHOLE = np.array([1, 1, 1, 255], np.float32)


def _backdrop(window: Window, design: Design, background: Colour | str | None) -> Pixels:
    if background == SCENE:
        return surroundings.wall(window, design).pixels
    pixels = Layer(window).pixels
    if background is not None:
        pixels[...] = (*background, 1)
    return pixels


def _over(above: NDArray[np.floating], below: NDArray[np.floating]) -> Pixels:
    return np.asarray(above + (1 - above[..., 3:4]) * below, dtype=np.float32)


def _put(above: Pixels, canvas: Canvas) -> None:
    """Lay premultiplied pixels over a canvas, in place."""
    mixed = above * _WHOLE
    mixed += (1 - above[..., 3:]) * canvas
    mixed += np.float32(0.5)
    canvas[...] = mixed


def _straight(frame: Bytes) -> Bytes:
    """Return premultiplied pixels with straight alpha, as files store them."""
    cover = frame[..., 3:].astype(np.uint16)
    edge = (cover[..., 0] > 0) & (cover[..., 0] < 255)
    frame[edge, :3] = np.minimum((frame[edge, :3].astype(np.uint16) * 255 + cover[edge] // 2) // cover[edge], 255)
    return frame
