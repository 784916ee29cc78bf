"""Pictures of poses for the encoder of a video: planes of brightness and of two colours, YUV 4:2:0.

The same stages as in ``portrait_rasteriser``, in the colours of the encoder from the first layer on: they are sums of
red, green and blue, so what is laid or mixed in one form is laid and mixed in the other one. The colours of a
video have a quarter of its pixels, and there is nothing to convert: a frame takes less than half of the time.
"""

from __future__ import annotations

from dataclasses import fields
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.base import SCENE
from lipmotion_faces.kernels.planes import (
    Box,
    EyeLayers,
    StillLayers,
    from_layer,
    lay_eyes,
    lay_skin,
    pack,
    to_layer,
    warp_planes,
)
from lipmotion_faces.portrait.design import Colour, Design
from lipmotion_faces.portrait.geometry import BrowField, HeadField, SkinField, brow_pose
from lipmotion_faces.portrait.layer import View, Window
from lipmotion_faces.portrait.mouth_painting import MouthPainter, MouthTextures, mouth_textures
from lipmotion_faces.portrait.parts import GAZE_STEPS, LID_POSITIONS, EyePainter, LidPose, lid_pose, paint_still_layers
from lipmotion_faces.portrait.portrait_rasteriser import FacePose, moving_parts

Bytes = NDArray[np.uint8]
Packed = NDArray[np.uint32]
Singles = NDArray[np.float32]

FROM_RGB = np.array([[65.481, 128.553, 24.966], [-37.797, -74.203, 112.0], [112.0, -93.786, -18.214]]) / 255.0
"""Brightness and two colours of red, green and blue of 0..255; ``OFFSETS`` are added."""
OFFSETS = np.array([16.0, 128.0, 128.0])
"""Source of both: ITU-R BT.601, limited range, as ``export.video`` marks its files."""


class PlanarCanvas:
    """What one thread draws on; it changes with every picture.

    planes : the picture before the head is moved [shape=(3, size, size)]
    packed : the same, packed for its warp
    upper  : what the upper half shows: lids, gaze, brows
    """

    def __init__(self, planes: Bytes, mouth: Window) -> None:
        self.planes, self.packed = planes, np.zeros(planes.shape, np.uint32)
        self.mouth = np.empty((mouth.y1 - mouth.y0, mouth.x1 - mouth.x0, 4), np.float32)
        self.upper: tuple[object, ...] = ()
        _pack(self, Box(0, 0, *planes.shape[1:]))


class PlanarRasteriser:
    """Draws a character at one size; ``picture`` may be called by several threads, each with a canvas of its own."""

    def __init__(self, design: Design, size: int, background: Colour | str = SCENE) -> None:
        view = View(size)
        self._parts = parts = moving_parts(view, design)
        layers = paint_still_layers(view.window(-9, -9, 9, 9), design, background)
        self._still = _bytes(_planes(layers.still)[:3])
        values = np.concatenate([_planes(layers.skin) * _COVER_AS_BYTE, layers.skin[None, ..., 4] * 255])
        planes, packed = _bytes(values), np.empty(values.shape, np.uint32)
        for plane, into in zip(planes, packed, strict=True):
            pack(plane, 0, 0, plane.shape[0], plane.shape[1], False, into)
        self._skin = packed
        self._around = StillLayers(_planes(layers.below)[:3], _planes(layers.shade)[:3], _planes(layers.front))
        self._jaw_layers, self._brow_layers = self._cut(parts.jaw), self._cut(parts.brow)
        self._head = Box(*(edge // 2 * 2 for edge in _box(parts.head)))
        self._eye_painter = EyePainter(design, parts.eyes)
        self._eyes = lru_cache(maxsize=LID_POSITIONS + 1)(self._paint_eyes)
        self._iris = _yuv(self._eye_painter.iris)
        self._skin_field, self._brow_field = SkinField(parts.jaw, design.lips), BrowField(parts.brow)
        self._head_field = HeadField(Window(view, self._head.x0, self._head.y0, self._head.x1, self._head.y1))
        textures = mouth_textures(design)
        in_yuv = {}
        for each in fields(textures):
            texture = getattr(textures, each.name)
            in_yuv[each.name] = np.concatenate([texture[..., :3] @ FROM_RGB.T + OFFSETS, texture[..., 3:]], axis=-1)
        self._mouth_painter = MouthPainter(design, parts.mouth, MouthTextures(**in_yuv))
        chroma = self._still[1:].reshape(2, size // 2, 2, size // 2, 2).mean(axis=(2, 4))
        self._frame = np.concatenate([self._still[0].ravel(), _bytes(chroma).ravel()]).reshape(-1, size)

    def canvas(self) -> PlanarCanvas:
        """Return a canvas with the resting face without eyes and mouth."""
        return PlanarCanvas(self._still.copy(), self._parts.mouth)

    def picture(self, pose: FacePose, canvas: PlanarCanvas) -> Bytes:
        """Return one frame [shape=(size · 3 / 2, size)], brightness above the two colours; the canvas is changed."""
        jaw, mouth = self._parts.jaw, self._parts.mouth
        skin, still = self._jaw_layers
        lay_skin(skin, *self._skin_field.shifts(pose.mouth, pose.mood), *still, jaw.y0, jaw.x0, canvas.planes)
        to_layer(canvas.planes, mouth.y0, mouth.x0, canvas.mouth)
        self._mouth_painter.paint(canvas.mouth, pose.mouth)
        from_layer(canvas.mouth, mouth.y0, mouth.x0, canvas.planes)
        _pack(canvas, _grown(_box(jaw)))
        self._paint_upper_half(pose, canvas)
        frame = self._frame.copy()
        warp_planes(canvas.packed, *self._head, *self._head_field.shifts(pose.head), *planes_of(frame))
        return frame

    def _paint_upper_half(self, pose: FacePose, canvas: PlanarCanvas) -> None:
        """Paint brows and eyes where they are not those of the last frame."""
        gaze, lids = GAZE_STEPS * self._parts.eyes.view.scale, lid_pose(pose.lids, pose.mood)
        x, y = round(pose.gaze_x * gaze), round(pose.gaze_y * gaze)
        brows = brow_pose(pose.brows, pose.mood, self._parts.brow.view.scale)
        if canvas.upper == (lids, x, y, brows):
            return
        canvas.upper = (lids, x, y, brows)
        brow, eyes, below = self._parts.brow, self._parts.eyes, self._parts.below_brows
        skin, still = self._brow_layers
        lay_skin(skin, *self._brow_field.shifts(brows), *still, brow.y0, brow.x0, canvas.planes)
        rows, columns = below.area
        canvas.planes[:, rows, columns] = self._still[:, rows, columns]
        x_px, y_px = np.float32(-x / GAZE_STEPS), np.float32(-y / GAZE_STEPS)
        lay_eyes(*self._eyes(lids), x_px, y_px, eyes.y0, eyes.x0, canvas.planes)
        _pack(canvas, _grown(_box(brow)))
        _pack(canvas, _grown(_box(eyes)))

    def _cut(self, window: Window) -> tuple[Packed, StillLayers]:
        """Return the skin, and what is around it, of a window."""
        rows, columns = window.area
        around = StillLayers(*(part[:, rows, columns].copy() for part in self._around))
        return self._skin[:, rows, columns].copy(), around

    def _paint_eyes(self, lids: LidPose) -> EyeLayers:
        under, opening, over = self._eye_painter.lids(lids)
        return EyeLayers(_yuv(under), np.ascontiguousarray(opening), _yuv(over), self._iris)


def planes_of(frame: Bytes) -> tuple[Bytes, Bytes, Bytes]:
    """Return brightness and both colours [shape=(H / 2, W / 2)] of a frame [shape=(H · 3 / 2, W)], which share its
    memory.
    """
    height, width = len(frame) * 2 // 3, frame.shape[1]
    colours = frame[height:].reshape(2, height // 2, width // 2)
    return frame[:height], colours[0], colours[1]


_COVER_AS_BYTE = np.array([1, 1, 1, 255], np.float32)[:, None, None]


def _yuv(pixels: NDArray[np.floating[Any]]) -> Singles:
    """Return premultiplied red, green, blue and cover as premultiplied brightness, two colours and cover."""
    colours = pixels[..., :3] @ FROM_RGB.T + pixels[..., 3:4] * OFFSETS
    return np.ascontiguousarray(np.concatenate([colours, pixels[..., 3:4]], axis=-1), np.float32)


def _planes(pixels: NDArray[np.floating[Any]]) -> Singles:
    """Return the same as planes [shape=(4, h, w)]."""
    return np.ascontiguousarray(_yuv(pixels).transpose(2, 0, 1))


def _bytes(values: NDArray[np.floating[Any]]) -> Bytes:
    return np.clip(values + 0.5, 0, 255).astype(np.uint8)


def _pack(canvas: PlanarCanvas, box: Box) -> None:
    for number in range(3):
        pack(canvas.planes[number], *box, number > 0, canvas.packed[number])


def _box(window: Window) -> Box:
    return Box(window.y0, window.x0, window.y1, window.x1)


def _grown(box: Box) -> Box:
    """Return a box with the pixels above and to the left whose neighbours are in it."""
    return Box(max(box.y0 - 2, 0), max(box.x0 - 2, 0), box.y1, box.x1)
