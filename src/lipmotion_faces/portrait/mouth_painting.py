"""Painting of the mouth of one pose. Runs for every frame."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.kernels.painting import paint_band
from lipmotion_faces.portrait.design import Design
from lipmotion_faces.portrait.geometry import (
    Heights,
    LipOutlines,
    MouthInterior,
    drawn_half_width,
    far_open,
    lip_outlines,
    mouth_interior,
)
from lipmotion_faces.portrait.mouth_textures import SPAN, MouthTextures, Texture, mouth_textures
from lipmotion_faces.portrait.pose import MouthPose
from lipmotion_faces.portrait.view import Window

COLUMNS = 4
"""Places in each column of pixels at which heights are computed."""
FOLD, FOLD_TOP = (0.19, 0.1), -0.235
"""A fold between nose and mouth begins so far from the middle, and ends so far beside the corner; its upper end lies so
far below the line of the lips."""
CORNER_REACH = 1.28
"""The shadows beside the corners are painted up to this multiple of the mouth's half width."""


class MouthPainter:
    """Paints mouths of one character into the pixels of one window.

    textures : of the mouth, in the colours of the layers that it is painted on; None: the design's own
    """

    def __init__(self, design: Design, window: Window, textures: MouthTextures | None = None) -> None:
        self._lips, self._textures = design.lips, textures or mouth_textures(design)
        self._x = window.columns(COLUMNS).reshape(-1, COLUMNS).T.astype(np.float64)
        self._scale, self._first_row = window.view.scale, window.y0 - window.view.origin[1]

    def paint(self, layer: NDArray[np.float32], pose: MouthPose) -> None:
        """Paint the mouth of a pose on the window's pixels [shape=(h, w, 4)], in place."""
        half_width = drawn_half_width(self._lips, pose)
        columns = np.flatnonzero(np.abs(self._x).max(axis=0) < half_width * CORNER_REACH)
        on = _Columns(layer, columns[0], columns[-1] + 1, self._scale, self._first_row)
        x = self._x[:, on.first : on.last]
        on_lips = _place(x, half_width)
        shape = lip_outlines(self._lips, pose, x)
        self._skin_shadows(on, shape, pose, x, on_lips)
        within = mouth_interior(self._lips, pose, x, shape) if pose.gap > 0 else None
        if within is not None:
            self._inside(on, shape, within, pose, x, on_lips)
        self._lips_around(on, shape, pose, on_lips)
        if within is not None:
            self._in_front(on, shape, within, pose, x)

    def _skin_shadows(self, on: _Columns, shape: LipOutlines, pose: MouthPose, x: Heights, on_lips: Heights) -> None:
        art = self._textures
        depth = 0.085 + 0.03 * pose.protrusion
        on.paint(shape.lower_outer, shape.lower_outer + depth, on_lips, art.under_lip)
        on.paint(shape.lower_outer, shape.lower_outer + 0.7 * depth, on_lips, art.under_lip, pose.tuck)
        self._folds(on, shape, pose)
        corner = np.full_like(x, shape.corner_y)
        on.paint(corner - 0.06, corner + 0.06, _place(x, shape.half_width * CORNER_REACH), art.corners)

    def _folds(self, on: _Columns, shape: LipOutlines, pose: MouthPose) -> None:
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

    def _lips_around(self, on: _Columns, shape: LipOutlines, pose: MouthPose, on_lips: Heights) -> None:
        art = self._textures
        on.paint(shape.upper_outer, shape.upper_inner, on_lips, art.upper_lip)
        on.paint(shape.lower_inner, shape.lower_outer, on_lips, art.lower_lip)
        on.paint(shape.upper_outer, shape.upper_inner, on_lips, art.pucker, pose.protrusion**2)
        on.paint(shape.lower_inner, shape.lower_outer, on_lips, art.pucker[::-1], pose.protrusion**2)
        closed = shape.lower_inner - shape.upper_inner < 2 * shape.seam
        middle = (shape.upper_inner + shape.lower_inner) / 2
        thick = np.where(closed, shape.seam, 0)
        on.paint(middle - thick, middle + thick, on_lips, art.seam)

    def _inside(
        self, on: _Columns, shape: LipOutlines, within: MouthInterior, pose: MouthPose, x: Heights, on_lips: Heights
    ) -> None:
        art = self._textures
        top, bottom = shape.upper_inner, shape.lower_inner
        across = _place(x, SPAN)
        on.paint(top, bottom, on_lips, art.cavity)
        on.paint(within.tongue_top, np.minimum(within.tongue_bottom, bottom), across, art.tongue)
        on.paint(within.teeth_lower, bottom, across, art.lower_teeth, min(2.5 * pose.teeth, 1))

    def _in_front(self, on: _Columns, shape: LipOutlines, within: MouthInterior, pose: MouthPose, x: Heights) -> None:
        """Paint the upper teeth, and what of the tongue is in front of the lower lip."""
        art = self._textures
        top, bottom = shape.upper_inner, shape.lower_inner
        across = _place(x, SPAN)
        if pose.tongue > 0.6:
            tip, out = within.tongue_bottom, (pose.tongue - 0.6) / 0.4
            on.paint(tip, np.where(tip > bottom, tip + 0.012, tip), across, art.lip_shadow, out)
            on.paint(within.tongue_top, tip, across, art.tongue_tip, out)
        seen = _seen(pose)  # teeth that are hardly seen are covered by the lip, from above; they are never grey
        low = top + min(1.2 * seen, 1) * (within.teeth_upper - top)
        on.paint(top, low, across, art.upper_teeth, min(5 * seen, 1))
        on.paint(top, np.minimum(top + 0.028 * (1 - 0.4 * pose.tuck), bottom), across, art.lip_shadow)
        if self._lips.outline:
            front = np.maximum(bottom, within.tongue_bottom) if pose.tongue > 0.6 else bottom
            self._outlines(on, shape, front, pose, across)

    def _outlines(self, on: _Columns, shape: LipOutlines, front: Heights, pose: MouthPose, across: Heights) -> None:
        """Paint lines round the hole, below a tucked lip, and round the ring of protruded lips."""
        line, top = 0.8 * self._lips.outline, shape.upper_inner
        hole = line * np.minimum((shape.lower_inner - top) / 0.01, 1)
        ring = line * np.minimum((shape.lower_outer - shape.upper_outer) / 0.01, 1)
        tucked, out = (min(max((share - 0.3) / 0.5, 0), 1) for share in (pose.tuck, pose.protrusion))
        for edge, thick in (
            (top, (1 - 0.3 * pose.tuck) * hole),
            (front, (1 - 0.7 * pose.tuck) * hole),
            (shape.upper_outer, out * ring),
            (shape.lower_outer, np.maximum(tucked * hole, out * ring)),
        ):
            on.paint(edge - thick / 2, edge + thick / 2, across, self._textures.outline)


def _seen(pose: MouthPose) -> float:
    """Return how much of the upper teeth is seen, 0..1: less behind lips that hardly part, unless the sound asks it."""
    asked = max(min(2.5 * pose.teeth, 1), far_open(pose), pose.tuck)
    return float(asked * max(min(max((pose.gap - 0.015) / 0.04, 0), 1), pose.tuck, 2 * pose.teeth - 1))


class _Columns(NamedTuple):
    """Some columns of a layer to paint on, with heights in eye distances."""

    layer: NDArray[np.float32]
    first: int
    last: int
    scale: float
    first_row: float

    def paint(self, top: Heights, bottom: Heights, across: Heights, texture: Texture, opacity: float = 1.0) -> None:
        if opacity <= 0:
            return
        if opacity < 1:
            texture = texture * (1, 1, 1, opacity)
        rows = top * self.scale - self.first_row, bottom * self.scale - self.first_row
        paint_band(self.layer[:, self.first : self.last], *rows, across, texture)


def _place(x: Heights, half_width: float) -> Heights:
    """Return the place of columns in a texture that spans a width, 0..1 [shape=(W,)]."""
    return np.clip(x.mean(axis=0) / (2 * half_width) + 0.5, 0, 1)
