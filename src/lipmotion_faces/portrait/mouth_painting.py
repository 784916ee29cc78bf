"""Painting of the mouth of one pose, which runs for every frame, and its textures.

A texture is a small picture that stretches with lips, teeth or tongue: colour 0..255 and opacity 0..1
[shape=(D, U, 4)], from the top of a band to its bottom, and across it. Across lips, -1 and 1 are the corners; across
teeth and tongue, they are ``SPAN`` eye distances from the middle.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.kernels.painting import paint_band
from lipmotion_faces.portrait import geometry
from lipmotion_faces.portrait.design import Colour, Design
from lipmotion_faces.portrait.layer import Window

Texture = NDArray[np.float64]

COLUMNS = 4  # places in each column of pixels at which heights are computed
FOLD, FOLD_TOP = (0.19, 0.1), -0.235
"""Where a fold begins, from the middle, and ends, from the corner; and its top, from the line of the lips."""
CORNER_REACH = 1.28  # the shadows beside the corners are painted up to this multiple of the mouth's half width
SPAN = 0.26
UPPER_TOOTH_GAPS = (0.0, 0.047, 0.087, 0.121, 0.15)
LOWER_TOOTH_GAPS = (0.0, 0.034, 0.068, 0.1, 0.13)  # distances from the middle of the face


class MouthPainter:
    """Paints mouths of a character into the pixels of one window."""

    def __init__(self, design: Design, window: Window) -> None:
        self._lips, colours = design.lips, design.palette
        self._textures = _make_textures(colours) if design.flat else _shade_textures(colours)
        self._x = window.list_columns(COLUMNS).reshape(-1, COLUMNS).T.astype(np.float64)
        self._scale, self._first_row = window.view.scale, window.y0 - window.view.origin[1]

    def paint(self, layer: NDArray[np.float32], pose: geometry.MouthPose) -> None:
        """Paint the mouth of a pose on the window's pixels [shape=(h, w, 4)], in place."""
        art, half_width = self._textures, geometry.compute_half_width(self._lips, pose)
        columns = np.flatnonzero(np.abs(self._x).max(axis=0) < half_width * CORNER_REACH)
        on = _Columns(layer, columns[0], columns[-1] + 1, self._scale, self._first_row)
        x = self._x[:, on.first : on.last]
        on_lips, across = _find_place(x, half_width), _find_place(x, SPAN)
        shape = geometry.outline_lips(self._lips, pose, x)
        depth = 0.085 + 0.03 * pose.protrusion
        on.paint(shape.lower_outer, shape.lower_outer + depth, on_lips, art.under_lip)
        on.paint(shape.lower_outer, shape.lower_outer + 0.7 * depth, on_lips, art.under_lip, pose.tuck)
        self._paint_folds(on, shape, pose)
        corner = np.full_like(x, shape.corner_y)
        on.paint(corner - 0.06, corner + 0.06, _find_place(x, shape.half_width * CORNER_REACH), art.corners)
        within = geometry.outline_interior(self._lips, pose, x, shape) if pose.gap > 0 else None
        if within is not None:
            bottom = shape.lower_inner
            on.paint(shape.upper_inner, bottom, on_lips, art.cavity)
            on.paint(within.tongue_top, np.minimum(within.tongue_bottom, bottom), across, art.tongue)
            on.paint(within.teeth_lower, bottom, across, art.lower_teeth, min(2.5 * pose.teeth, 1))
        on.paint(shape.upper_outer, shape.upper_inner, on_lips, art.upper_lip)
        on.paint(shape.lower_inner, shape.lower_outer, on_lips, art.lower_lip)
        on.paint(shape.upper_outer, shape.upper_inner, on_lips, art.pucker, pose.protrusion**2)
        on.paint(shape.lower_inner, shape.lower_outer, on_lips, art.pucker[::-1], pose.protrusion**2)
        closed = shape.lower_inner - shape.upper_inner < 2 * shape.seam
        middle = (shape.upper_inner + shape.lower_inner) / 2
        thick = np.where(closed, shape.seam, 0)
        on.paint(middle - thick, middle + thick, on_lips, art.seam)
        if within is not None:
            self._paint_front(on, shape, within, pose, across)

    def _paint_folds(self, on: _Columns, shape: geometry.LipOutlines, pose: geometry.MouthPose) -> None:
        """Paint the folds between nose and corners that a raised upper lip draws."""
        if pose.upper_raise <= 0:
            return
        line_y, inner, outer = self._lips.line_y, FOLD[0], shape.half_width + FOLD[1]
        chosen = np.flatnonzero(np.abs(self._x).max(axis=0) < outer + 0.02)
        wide = on._replace(first=int(chosen[0]), last=int(chosen[-1]) + 1)
        share = np.clip((np.abs(self._x[:, wide.first : wide.last]) - inner) / (outer - inner), 0, 1)
        top = line_y + FOLD_TOP - 0.03 * pose.upper_raise
        middle = top + (shape.corner_y - 0.01 - top) * share**1.25
        wide.paint(middle - 0.03, middle + 0.03, share.mean(axis=0), self._textures.fold, pose.upper_raise)

    def _paint_front(
        self,
        on: _Columns,
        shape: geometry.LipOutlines,
        within: geometry.MouthInterior,
        pose: geometry.MouthPose,
        across: geometry.Heights,
    ) -> None:
        """Paint the upper teeth, what of the tongue is in front of the lower lip, and the lines of a drawn mouth."""
        art = self._textures
        top, front = shape.upper_inner, shape.lower_inner
        on_top = np.minimum(top + 0.028 * (1 - 0.4 * pose.tuck), front)
        if pose.tongue > 0.6:
            tip, out = within.tongue_bottom, (pose.tongue - 0.6) / 0.4
            on.paint(tip, np.where(tip > front, tip + 0.012, tip), across, art.lip_shadow, out)
            on.paint(within.tongue_top, tip, across, art.tongue_tip, out)
            front = np.maximum(front, tip)
        # teeth show less behind lips that hardly part, unless the sound asks for them; what is hardly seen of them is
        # covered by the lip, from above: they are never grey
        shown = max(min(2.5 * pose.teeth, 1), geometry.measure_far_open(pose), pose.tuck)
        shown = float(shown * max(min(max((pose.gap - 0.015) / 0.04, 0), 1), pose.tuck, 2 * pose.teeth - 1))
        low = top + min(1.2 * shown, 1) * (within.teeth_upper - top)
        on.paint(top, low, across, art.upper_teeth, min(5 * shown, 1))
        on.paint(top, on_top, across, art.lip_shadow)
        if not self._lips.outline:
            return
        line = 0.8 * self._lips.outline
        hole = line * np.minimum((shape.lower_inner - top) / 0.01, 1)
        ring = line * np.minimum((shape.lower_outer - shape.upper_outer) / 0.01, 1)
        tucked, out = (min(max((share - 0.3) / 0.5, 0), 1) for share in (pose.tuck, pose.protrusion))
        outside = 0.5 * out * hole  # outside a round hole, which it would fill
        for edge, thick in (
            (top - outside, (1 - 0.3 * pose.tuck) * hole),
            (front + outside, (1 - 0.7 * pose.tuck) * hole),
            (shape.upper_outer, out * ring),
            (shape.lower_outer, np.maximum(tucked * hole, out * ring)),
        ):
            on.paint(edge - thick / 2, edge + thick / 2, across, art.outline)


class _Columns(NamedTuple):
    """Some columns of a layer to paint on, with heights in eye distances."""

    layer: NDArray[np.float32]
    first: int
    last: int
    scale: float
    first_row: float

    def paint(
        self,
        top: geometry.Heights,
        bottom: geometry.Heights,
        across: geometry.Heights,
        texture: Texture,
        opacity: float = 1.0,
    ) -> None:
        if opacity <= 0:
            return
        if opacity < 1:
            texture = texture * (1, 1, 1, opacity)
        rows = top * self.scale - self.first_row, bottom * self.scale - self.first_row
        paint_band(self.layer[:, self.first : self.last], *rows, across, texture)


def _find_place(x: geometry.Heights, half_width: float) -> geometry.Heights:
    """Return the place of columns in a texture that spans a width, 0..1 [shape=(W,)]."""
    return np.clip(x.mean(axis=0) / (2 * half_width) + 0.5, 0, 1)


@dataclass(frozen=True, eq=False)
class MouthTextures:
    """The textures of one character's mouth."""

    upper_lip: Texture
    lower_lip: Texture
    seam: Texture
    cavity: Texture
    upper_teeth: Texture
    lower_teeth: Texture
    tongue: Texture
    tongue_tip: Texture
    pucker: Texture
    lip_shadow: Texture
    under_lip: Texture
    corners: Texture
    fold: Texture
    outline: Texture


def _make_textures(colours: SimpleNamespace) -> MouthTextures:
    """Return textures of one colour each, with lines between the incisors and a patch of light on the tongue's tip."""
    _, x = _make_grid(1, 261)
    away = np.abs(np.abs(x) * SPAN - np.array(UPPER_TOOTH_GAPS[:3])[:, None, None]).min(axis=0)
    teeth = _mix(colours.tooth, colours.lower_lip_dark, 0.6 * np.exp(-((away / 0.003) ** 2)))
    depth, x = _make_grid(24, 65)
    light = np.array(colours.tongue) + (255 - np.array(colours.tongue)) * 0.45
    patch = 1 - np.clip((((depth - 0.55) / 0.14) ** 2 + ((x * SPAN + 0.015) / 0.05) ** 2 - 1) / 0.5, 0, 1)
    depth, x = _make_grid(15, 65)
    fold = (np.abs(depth - 0.5) < 0.17 * np.clip((1 - np.abs(x)) / 0.4, 0, 1)).astype(np.float64)
    clear = _make_texture(colours.line, 0.0)
    return MouthTextures(
        upper_lip=_make_texture(colours.upper_lip_dark),
        lower_lip=_make_texture(colours.lower_lip_light),
        seam=_make_texture(colours.line),
        cavity=_make_texture(colours.cavity),
        upper_teeth=_make_texture(teeth),
        lower_teeth=_make_texture(colours.lower_tooth),
        tongue=_make_texture(colours.tongue),
        tongue_tip=_make_texture(_mix(colours.tongue, light, patch)),
        pucker=clear,
        lip_shadow=clear,
        under_lip=_paint_under_lip(colours.skin_shade, 0.5),
        corners=clear,
        fold=_make_texture(colours.line, 0.8 * fold),
        outline=_make_texture(colours.line),
    )


def _shade_textures(colours: SimpleNamespace) -> MouthTextures:
    depth, x = _make_grid(9, 33)
    seam = np.sin(np.pi * depth) ** 0.5 * (1 - 0.6 * np.abs(x) ** 3)
    depth, x = _make_grid(12, 17)
    cavity = _mix(colours.cavity, colours.tongue, 0.16 * depth**2 * (1 - x**2))
    depth, x = _make_grid(24, 129)
    folds = np.abs(np.sin(np.pi * 6.5 * (np.abs(x) + 0.035 * np.sin(9 * x)))) ** 5 * (1 - x**4)
    folded = 0.1 * folds * np.sin(np.pi * np.clip(0.15 + 0.9 * depth, 0, 1)) * np.clip(np.abs(x) / 0.1, 0, 1)
    pucker = _mix(colours.upper_lip_dark, colours.seam, 0.25 + 0 * depth * x)
    depth, x = _make_grid(15, 65)
    corners = np.exp(-(((depth - 0.5) / 0.2) ** 2) - ((np.abs(x) - 0.78) / 0.055) ** 2)
    fold = np.exp(-(((depth - 0.5) / 0.2) ** 2)) * np.clip((1 - np.abs(x)) / 0.5, 0, 1)
    upper_lip, lower_lip = _paint_lips(colours)
    tongue, tongue_tip = _paint_tongue(colours)
    return MouthTextures(
        upper_lip=upper_lip,
        lower_lip=lower_lip,
        seam=_make_texture(colours.seam, seam),
        cavity=_make_texture(cavity),
        upper_teeth=_paint_teeth(colours.tooth, colours.mouth_shadow, UPPER_TOOTH_GAPS, 0.5),
        lower_teeth=_paint_teeth(colours.lower_tooth, colours.mouth_shadow, LOWER_TOOTH_GAPS, 0.45)[::-1].copy(),
        tongue=tongue,
        tongue_tip=tongue_tip,
        pucker=_make_texture(pucker, folded),
        lip_shadow=_make_texture(colours.cavity, 0.62 * (1 - _make_grid(12, 1)[0]) ** 1.6),
        under_lip=_paint_under_lip(colours.mouth_shadow, 0.42),
        corners=_make_texture(colours.mouth_shadow, 0.34 * corners),
        fold=_make_texture(colours.mouth_shadow, 0.5 * fold),
        outline=_make_texture(colours.line, 0.0),
    )


def _paint_lips(colours: SimpleNamespace) -> tuple[Texture, Texture]:
    """Return the upper and the lower lip, with fine creases down them and gloss."""

    def draw_creases(depth: Texture) -> Texture:
        lines = np.sin(31 * x + 2.1 * np.sin(7 * x)) * np.sin(17.3 * x + 1.0)
        return np.clip(lines, 0, 1) * np.sin(np.pi * np.clip(depth, 0, 1)) * (1 - x**6)

    depth, x = _make_grid(24, 97)
    gloss = 0.42 * np.exp(-(((depth - 0.22) / 0.14) ** 2) - ((np.abs(x + 0.03) - 0.2) / 0.17) ** 2)
    paint = _mix(colours.upper_lip_light, colours.upper_lip_dark, depth**1.3 + 0 * x)
    paint = _mix(paint, colours.seam, 0.3 * np.abs(x) ** 4 + 0.35 * np.clip(depth - 0.82, 0, 1) / 0.18)
    paint = _mix(paint, colours.upper_lip_dark, 0.16 * draw_creases(depth))
    upper = _make_texture(_mix(paint, colours.gloss, gloss), np.clip(0.25 + depth / 0.12, 0, 1) + 0 * x)
    depth, _ = _make_grid(32, 97)
    gloss = 0.6 * np.exp(-(((depth - 0.36) / 0.17) ** 2) - ((x + 0.08) / 0.33) ** 2)
    gloss += 0.16 * np.exp(-(((depth - 0.3) / 0.12) ** 2) - ((x - 0.42) / 0.12) ** 2)
    paint = _mix(colours.lower_lip_light, colours.lower_lip_dark, (1.9 * depth - 0.75) ** 2 + 0.3 * x**4)
    paint = _mix(paint, colours.lower_lip_dark, 0.16 * draw_creases(depth))
    paint = _mix(paint, colours.gloss, gloss * (1 - 0.15 * draw_creases(depth)))
    return upper, _make_texture(paint, np.clip(0.2 + (1 - depth) / 0.14, 0, 1) + 0 * x)


def _paint_teeth(colour: Colour, shadow: Colour, gaps: tuple[float, ...], dark: float) -> Texture:
    depth, x = _make_grid(10, 261)
    away = np.abs(np.abs(x) * SPAN - np.array(gaps)[:, None, None]).min(axis=0)
    paint = _mix(colour, shadow, 0.2 * np.exp(-((away / 0.0032) ** 2)) * (0.35 + 0.65 * depth))
    paint = _mix(paint, shadow, dark * (1 - depth) ** 2.2 + 0.0 * x)
    return _make_texture(paint, np.exp(-((x * SPAN / 0.21) ** 4)) + 0 * depth)


def _paint_tongue(colours: SimpleNamespace) -> tuple[Texture, Texture]:
    """Return the tongue, and its tip between the teeth: in the shadow of the upper ones, round, moist at its edge."""
    colour, dark = np.array(colours.tongue), colours.cavity
    depth, x = _make_grid(16, 65)
    away = x * SPAN
    paint = _mix(colour, dark, 0.45 * depth**1.5 + 3.0 * np.abs(away) ** 1.3)
    shine = 0.6 * np.exp(-(((depth - 0.22) / 0.2) ** 2) - ((np.abs(away) - 0.045) / 0.045) ** 2)
    paint = _mix(paint, colour + (255 - colour) * 0.42, shine)
    paint = _mix(paint, dark, 0.25 * np.exp(-((away / 0.012) ** 2)) * (0.2 + 0.8 * depth))
    tongue = _make_texture(paint, np.exp(-((away / 0.2) ** 6)) + 0 * depth)
    depth, _ = _make_grid(24, 65)
    flesh = 0.6 * colour + 0.4 * np.array(colours.lower_lip_light) + 8
    tip = _mix(flesh, dark, 0.4 * (1 - depth) ** 2 + 0.3 * (np.abs(away) / 0.1) ** 4)
    shine = 0.3 * np.exp(-(((depth - 0.7) / 0.16) ** 2) - ((away + 0.012) / 0.045) ** 2)
    return tongue, _make_texture(_mix(tip, colour + (255 - colour) * 0.75, shine))


def _paint_under_lip(colour: Colour, strength: float) -> Texture:
    depth, x = _make_grid(16, 33)
    soft = np.exp(-(((depth - 0.32) / 0.26) ** 2)) * (1 - depth) ** 0.5 * np.exp(-((x / 0.62) ** 2))
    return _make_texture(colour, strength * soft)


def _make_grid(deep: int, wide: int) -> tuple[Texture, Texture]:
    """Return depth 0..1 [shape=(D, 1)] and place across -1..1 [shape=(1, U)]."""
    return np.linspace(0, 1, deep)[:, None], np.linspace(-1, 1, wide)[None, :]


def _make_texture(colour: Colour | Texture, opacity: Texture | float = 1.0) -> Texture:
    paint, cover = np.asarray(colour, dtype=np.float64), np.atleast_2d(opacity)
    shape = np.broadcast_shapes(paint.shape[:-1], cover.shape)
    return np.dstack([np.broadcast_to(paint, (*shape, 3)), np.broadcast_to(cover, shape)])


def _mix(first: Colour | Texture, second: Colour | Texture, share: Texture) -> Texture:
    start = np.asarray(first, dtype=np.float64)
    return start + np.clip(share, 0, 1)[..., None] * (np.asarray(second, dtype=np.float64) - start)
