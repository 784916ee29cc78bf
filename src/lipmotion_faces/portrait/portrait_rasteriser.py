"""Pictures of poses. The portrait is painted once; for each frame only what moves is painted again."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.liveliness import CALM, UpperFace
from lipmotion_faces.kernels.painting import stack, warp, warp_bytes
from lipmotion_faces.portrait import surroundings
from lipmotion_faces.portrait.design import WHITE, Colour, Design
from lipmotion_faces.portrait.eyes import EyePainter
from lipmotion_faces.portrait.layer import Glow, Layer, Rim
from lipmotion_faces.portrait.mouth_painting import MouthPainter
from lipmotion_faces.portrait.movement import STEP, BrowField, BrowPose, HeadField, HeadPlacement, SkinField, brow_pose
from lipmotion_faces.portrait.outlines import Points, both_sides, ellipse, open_curve, stroke
from lipmotion_faces.portrait.pose import MouthPose
from lipmotion_faces.portrait.view import View, Window


def paint_head(window: Window, design: Design) -> Layer:
    """Return a layer with the bald head without eyes and mouth."""
    layer, colours, skull = Layer(window), design.palette, design.skull
    if design.flat:
        layer.fill(skull, colours.skin)
        layer.fill(_shade_of(skull), colours.skin_shade, opacity=0.5, within=skull)
        for cheek in (-1, 1):
            layer.fill(ellipse(cheek * 0.46, 0.5, 0.13, 0.08), colours.blush, opacity=design.blush)
        _flat_nose(layer, design)
        layer.contour(skull, design.line, colours.line)
    else:
        layer.fill(skull, colours.skin, Rim(0.16, colours.skin_shade, 0.62), *_light_and_shade(design))
        _beard(layer, design)
        _nose(layer, design)
        _philtrum(layer, design)
    brow = stroke(open_curve(design.eyes.brow), design.eyes.brow_widths)
    for side in both_sides(brow):
        if design.flat:
            layer.fill(side, colours.hair_dark)
        else:
            layer.fill(side, colours.hair, opacity=0.92, blur=0.007)
    return layer


def _shade_of(skull: Points) -> Points:
    """Return the side of the head that is away from the light, as one flat shape."""
    inner = skull * (0.86, 0.97) + (-0.06, -0.02)
    return np.vstack([skull[skull[:, 0] >= 0], inner[inner[:, 0] >= 0][::-1]])


def _light_and_shade(design: Design) -> list[Glow]:
    colours = design.palette
    forehead = Glow(-0.05, -0.35, 0.5, 0.35, colours.skin_light, 0.55)
    chin = Glow(0.0, 1.24, 0.16, 0.09, colours.skin_light, 0.45)
    glows = [forehead, chin]
    for side in (-1, 1):
        glows += [
            Glow(side * 0.43, 0.54, 0.23, 0.18, colours.blush, design.blush),
            Glow(side * 0.36, 0.30, 0.2, 0.1, colours.skin_light, 0.5),
            Glow(side * 0.34, -0.08, 0.24, 0.12, colours.skin_shade, 0.38),
        ]
    return glows


def _beard(layer: Layer, design: Design) -> None:
    if design.beard:
        y = design.lips.line_y
        shade = design.palette.beard
        for x, at, wide, high in ((0, y + 0.28, 0.46, 0.26), (-0.5, y - 0.02, 0.2, 0.3), (0.5, y - 0.02, 0.2, 0.3)):
            layer.fill(ellipse(x, at, wide, high), shade, opacity=design.beard, blur=0.09, within=design.skull)
        layer.fill(ellipse(0, y - 0.15, 0.26, 0.07), shade, opacity=0.8 * design.beard, blur=0.05)


def _nose(layer: Layer, design: Design) -> None:
    colours, wide = design.palette, (design.nose_width, 1.0)
    layer.fill(ellipse(0, 0.61, 0.19, 0.06) * wide, colours.skin_shade, opacity=0.75, blur=0.03)
    layer.fill(ellipse(0, 0.545, 0.13, 0.075) * wide, colours.skin_light, opacity=0.7, blur=0.04)
    sides = both_sides(stroke(open_curve("0.125 -0.1, 0.085 0.12, 0.1 0.36"), [0.03, 0.05, 0.02]) * wide)
    for bridge, opacity in zip(sides, (0.45, 0.25), strict=True):
        layer.fill(bridge, colours.skin_shade, opacity=opacity, blur=0.025)
    for wing in both_sides(stroke(open_curve("0.155 0.5, 0.195 0.57, 0.165 0.635"), [0, 0.022, 0]) * wide):
        layer.fill(wing, colours.skin_deep, opacity=0.6, blur=0.008)
    for nostril in both_sides(stroke(open_curve("0.035 0.632, 0.085 0.615, 0.135 0.632"), [0, 0.034, 0]) * wide):
        layer.fill(nostril, colours.skin_deep, opacity=0.9, blur=0.005)
    base = stroke(open_curve("-0.04 0.645, 0 0.655, 0.04 0.645"), [0, 0.012, 0])
    layer.fill(base, colours.skin_deep, opacity=0.5, blur=0.006)
    layer.fill(ellipse(-0.02, 0.3, 0.03, 0.2) * wide, colours.skin_light, opacity=0.6, blur=0.03)
    layer.fill(ellipse(-0.02, 0.545, 0.035, 0.022), WHITE, opacity=0.45, blur=0.015)


def _flat_nose(layer: Layer, design: Design) -> None:
    colours = design.palette
    layer.fill(ellipse(0.03, 0.52, 0.1, 0.06), colours.skin_shade, opacity=0.55)
    line = stroke(
        open_curve("-0.1 0.5, -0.075 0.565, 0.0 0.585, 0.075 0.565, 0.1 0.5"), [0.0, 0.024, 0.026, 0.024, 0.0]
    )
    layer.fill(line, colours.line)


def _philtrum(layer: Layer, design: Design) -> None:
    colours = design.palette
    layer.fill(ellipse(0, 0.745, 0.028, 0.06), colours.skin_shade, opacity=0.4, blur=0.02)
    for ridge in both_sides(ellipse(0.052, 0.76, 0.014, 0.05)):
        layer.fill(ridge, colours.skin_light, opacity=0.5, blur=0.016)


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
