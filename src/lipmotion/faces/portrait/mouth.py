"""Painting of the mouth of one pose. Runs for every frame."""

from __future__ import annotations

import numpy as np

from lipmotion.faces.portrait import palette
from lipmotion.faces.portrait.bands import COLUMNS, Bands
from lipmotion.faces.portrait.geometry import LipOutlines, MouthInterior, lip_outlines, mouth_interior, roundness
from lipmotion.faces.portrait.palette import Colour
from lipmotion.faces.portrait.pose import MouthPose
from lipmotion.faces.portrait.view import Pixels, Window

UPPER_TOOTH_GAPS = (0.0, 0.045, 0.083, 0.115, 0.145)
LOWER_TOOTH_GAPS = (0.0, 0.034, 0.068, 0.105)
"""Distances from the middle of the face."""


def paint_mouth(picture: Pixels, window: Window, pose: MouthPose) -> None:
    """Paint the mouth of a pose into the pixels of a window [shape=(h, w, 3)], in place."""
    x = window.columns(COLUMNS).reshape(-1, COLUMNS).T
    shape = lip_outlines(pose, x)
    face = Bands.of(picture, window).between(float(shape.upper_outer.min()), float(shape.lower_outer.max()) + 0.12)
    _skin_shadows(face, shape)
    _upper_and_lower_lip(face, shape)
    if pose.gap > 0:
        _teeth_and_tongue(face, shape, mouth_interior(pose, x, shape), pose)


def _skin_shadows(face: Bands, shape: LipOutlines) -> None:
    """Shade the skin under the lower lip and beside the corners."""
    under = ((face.y - shape.lower_outer.mean(axis=0) - 0.03) / 0.04) ** 2
    face.blend(0.4 * np.exp(-under - (face.x / (0.62 * shape.half_width)) ** 2), palette.MOUTH_SHADOW)
    away = ((np.abs(face.x) - shape.half_width - 0.005) / 0.03) ** 2
    face.blend(0.3 * np.exp(-away - ((face.y - shape.corner_y) / 0.026) ** 2), palette.MOUTH_SHADOW)


def _upper_and_lower_lip(face: Bands, shape: LipOutlines) -> None:
    x = face.x / shape.half_width
    lower = face.between(float(shape.lower_inner.min()), float(shape.lower_outer.max()))
    depth = lower.depth(shape.lower_inner, shape.lower_outer)
    gloss = 0.55 * np.exp(-(((depth - 0.4) / 0.22) ** 2) - ((x + 0.06) / 0.36) ** 2)
    colour = _mix(_mix(palette.LOWER_LIP_LIGHT, palette.LOWER_LIP_DARK, (2 * depth - 0.8) ** 2), palette.GLOSS, gloss)
    lower.fill(shape.upper_outer, shape.lower_outer, colour)

    upper = face.between(float(shape.upper_outer.min()), float(shape.upper_inner.max()))
    depth = upper.depth(shape.upper_outer, shape.upper_inner)
    shine = 0.3 * np.exp(-(((depth - 0.2) / 0.16) ** 2) - ((np.abs(x) - 0.2) / 0.16) ** 2)
    colour = _mix(_mix(palette.UPPER_LIP_LIGHT, palette.UPPER_LIP_DARK, depth), palette.GLOSS, shine)
    upper.fill(shape.upper_outer, shape.upper_inner, colour)
    face.fill(shape.upper_inner - shape.seam, shape.lower_inner + shape.seam, palette.SEAM)


def _teeth_and_tongue(face: Bands, shape: LipOutlines, within: MouthInterior, pose: MouthPose) -> None:
    top, bottom = shape.upper_inner, shape.lower_inner
    hole = face.between(float(top.min()), float(bottom.max()))
    hole.fill(top, bottom, palette.CAVITY)
    arch = np.exp(-((hole.x / 0.19) ** 4)) * (1 - 0.4 * roundness(pose)) * pose.teeth
    hole.fill(within.teeth_lower, bottom, palette.LOWER_TOOTH, 0.95 * arch)
    hole.fill(within.teeth_lower, bottom, palette.MOUTH_SHADOW, 0.32 * pose.teeth * _lines(hole, LOWER_TOOTH_GAPS))
    hole.fill(top, within.teeth_upper, palette.TOOTH, arch)
    hole.fill(top, within.teeth_upper, palette.MOUTH_SHADOW, 0.32 * pose.teeth * _lines(hole, UPPER_TOOTH_GAPS))
    lit = np.exp(-((hole.x / 0.16) ** 2)) * (0.75 + 0.25 * pose.tip)
    hole.fill(within.tongue_top, within.tongue_bottom, palette.TONGUE, lit)
    groove = 0.2 * np.exp(-((hole.x / 0.018) ** 2))
    hole.fill(within.tongue_top + 0.015, within.tongue_bottom, palette.SEAM, groove)
    under_lip = np.exp(-np.maximum(hole.y - top.mean(axis=0), 0) / 0.02)
    hole.fill(top, bottom, palette.CAVITY, 0.5 * under_lip)


def _lines(hole: Bands, distances: tuple[float, ...]) -> Pixels:
    """Return the coverage by thin vertical lines at these distances on both sides, 0..1 [shape=(W,)]."""
    away = np.abs(np.abs(hole.x) - np.array(distances, dtype=np.float32)[:, None]).min(axis=0)
    return np.exp(-((away / max(0.0035, 0.6 * hole.pixel)) ** 2))


def _mix(first: Colour | Pixels, second: Colour, share: Pixels) -> Pixels:
    start = np.asarray(first, dtype=np.float32)
    return start + np.clip(share, 0, 1)[..., None] * (np.asarray(second, dtype=np.float32) - start)
