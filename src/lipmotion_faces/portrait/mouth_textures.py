"""Textures of the mouth: small pictures that stretch with lips, teeth and tongue.

A texture is colour 0..255 and opacity 0..1 [shape=(D, U, 4)]: from the top of a band to its bottom, and across it.
Across lips, -1 and 1 are the corners; across teeth and tongue, they are ``SPAN`` eye distances from the middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.portrait.design import Colour, Design

Texture = NDArray[np.float64]

SPAN = 0.26
UPPER_TOOTH_GAPS = (0.0, 0.047, 0.087, 0.121, 0.15)
LOWER_TOOTH_GAPS = (0.0, 0.034, 0.068, 0.1, 0.13)
"""Distances from the middle of the face."""


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


def mouth_textures(design: Design) -> MouthTextures:
    """Return the textures of a character's mouth."""
    colours, flat = design.palette, design.flat
    if flat:
        clear = _flat(colours.line, 0.0)
        return MouthTextures(
            upper_lip=_flat(colours.upper_lip_dark),
            lower_lip=_flat(colours.lower_lip_light),
            seam=_flat(colours.line),
            cavity=_flat(colours.cavity),
            upper_teeth=_flat_teeth(colours.tooth, colours.lower_lip_dark),
            lower_teeth=_flat(colours.lower_tooth),
            tongue=_flat(colours.tongue),
            tongue_tip=_flat_tip(colours.tongue),
            pucker=clear,
            lip_shadow=clear,
            under_lip=_under_lip(colours.skin_shade, 0.5),
            corners=clear,
            fold=_flat_fold(colours.line),
            outline=_flat(colours.line),
        )
    return MouthTextures(
        upper_lip=_upper_lip(design),
        lower_lip=_lower_lip(design),
        seam=_seam(colours.seam),
        cavity=_cavity(colours.cavity, colours.tongue),
        upper_teeth=_teeth(colours.tooth, colours.mouth_shadow, UPPER_TOOTH_GAPS, 0.5),
        lower_teeth=_teeth(colours.lower_tooth, colours.mouth_shadow, LOWER_TOOTH_GAPS, 0.45)[::-1].copy(),
        tongue=_tongue(colours.tongue, colours.cavity),
        tongue_tip=_tongue_tip(colours.tongue, colours.lower_lip_light, colours.cavity),
        pucker=_pucker(colours.upper_lip_dark, colours.seam),
        lip_shadow=_lip_shadow(colours.cavity),
        under_lip=_under_lip(colours.mouth_shadow, 0.42),
        corners=_corners(colours.mouth_shadow),
        fold=_fold(colours.mouth_shadow),
        outline=_flat(colours.line, 0.0),
    )


def _grid(deep: int, wide: int) -> tuple[Texture, Texture]:
    """Return depth 0..1 [shape=(D, 1)] and place across -1..1 [shape=(1, U)]."""
    return np.linspace(0, 1, deep)[:, None], np.linspace(-1, 1, wide)[None, :]


def _flat(colour: Colour, opacity: float = 1.0) -> Texture:
    return np.array([[[*colour, opacity]]], dtype=np.float64)


def _texture(colour: Texture, opacity: Texture | float) -> Texture:
    shape = np.broadcast_shapes(colour.shape[:2], np.shape(opacity))
    return np.dstack([np.broadcast_to(colour, (*shape, 3)), np.broadcast_to(opacity, shape)])


def _mix(first: Colour | Texture, second: Colour | Texture, share: Texture) -> Texture:
    start = np.asarray(first, dtype=np.float64)
    return start + np.clip(share, 0, 1)[..., None] * (np.asarray(second, dtype=np.float64) - start)


def _creases(x: Texture, depth: Texture) -> Texture:
    """Return the strength of the fine lines down a lip, 0..1."""
    lines = np.sin(31 * x + 2.1 * np.sin(7 * x)) * np.sin(17.3 * x + 1.0)
    return np.clip(lines, 0, 1) * np.sin(np.pi * np.clip(depth, 0, 1)) * (1 - x**6)


def _upper_lip(design: Design) -> Texture:
    colours = design.palette
    depth, x = _grid(24, 97)
    shine = 0.42 * np.exp(-(((depth - 0.22) / 0.14) ** 2) - ((np.abs(x + 0.03) - 0.2) / 0.17) ** 2)
    paint = _mix(colours.upper_lip_light, colours.upper_lip_dark, depth**1.3 + 0 * x)
    paint = _mix(paint, colours.seam, 0.3 * np.abs(x) ** 4 + 0.35 * np.clip(depth - 0.82, 0, 1) / 0.18)
    paint = _mix(paint, colours.upper_lip_dark, 0.16 * _creases(x, depth))
    paint = _mix(paint, colours.gloss, shine)
    return _texture(paint, np.clip(0.25 + depth / 0.12, 0, 1) + 0 * x)


def _lower_lip(design: Design) -> Texture:
    colours = design.palette
    depth, x = _grid(32, 97)
    gloss = 0.6 * np.exp(-(((depth - 0.36) / 0.17) ** 2) - ((x + 0.08) / 0.33) ** 2)
    gloss += 0.16 * np.exp(-(((depth - 0.3) / 0.12) ** 2) - ((x - 0.42) / 0.12) ** 2)
    paint = _mix(colours.lower_lip_light, colours.lower_lip_dark, (1.9 * depth - 0.75) ** 2 + 0.3 * x**4)
    paint = _mix(paint, colours.lower_lip_dark, 0.16 * _creases(x, depth))
    paint = _mix(paint, colours.gloss, gloss * (1 - 0.15 * _creases(x, depth)))
    return _texture(paint, np.clip(0.2 + (1 - depth) / 0.14, 0, 1) + 0 * x)


def _seam(colour: Colour) -> Texture:
    depth, x = _grid(9, 33)
    return _texture(
        np.array(colour, dtype=np.float64)[None, None], np.sin(np.pi * depth) ** 0.5 * (1 - 0.6 * np.abs(x) ** 3)
    )


def _cavity(colour: Colour, flesh: Colour) -> Texture:
    depth, x = _grid(12, 17)
    return _texture(_mix(colour, flesh, 0.16 * depth**2 * (1 - x**2)), 1.0)


def _teeth(colour: Colour, shadow: Colour, gaps: tuple[float, ...], dark: float) -> Texture:
    depth, x = _grid(10, 261)
    away = np.abs(np.abs(x) * SPAN - np.array(gaps)[:, None, None]).min(axis=0)
    paint = _mix(colour, shadow, 0.2 * np.exp(-((away / 0.0032) ** 2)) * (0.35 + 0.65 * depth))
    paint = _mix(paint, shadow, dark * (1 - depth) ** 2.2 + 0.0 * x)
    side = np.exp(-((x * SPAN / 0.21) ** 4))
    return _texture(paint, side + 0 * depth)


def _flat_teeth(colour: Colour, line: Colour) -> Texture:
    """Return teeth of one colour, with lines between the incisors."""
    _, x = _grid(1, 261)
    away = np.abs(np.abs(x) * SPAN - np.array(UPPER_TOOTH_GAPS[:3])[:, None, None]).min(axis=0)
    return _texture(_mix(colour, line, 0.6 * np.exp(-((away / 0.003) ** 2))), 1.0)


def _tongue(colour: Colour, dark: Colour) -> Texture:
    depth, x = _grid(16, 65)
    away = x * SPAN
    light = np.array(colour) + (255 - np.array(colour)) * 0.42
    paint = _mix(colour, dark, 0.45 * depth**1.5 + 3.0 * np.abs(away) ** 1.3)
    paint = _mix(paint, light, 0.6 * np.exp(-(((depth - 0.22) / 0.2) ** 2) - ((np.abs(away) - 0.045) / 0.045) ** 2))
    paint = _mix(paint, dark, 0.25 * np.exp(-((away / 0.012) ** 2)) * (0.2 + 0.8 * depth))
    return _texture(paint, np.exp(-((away / 0.2) ** 6)) + 0 * depth)


def _tongue_tip(colour: Colour, lip: Colour, dark: Colour) -> Texture:
    """Return the tip between the teeth: in the shadow of the upper ones, round, moist at its edge."""
    depth, x = _grid(24, 65)
    away = x * SPAN
    flesh = 0.6 * np.array(colour) + 0.4 * np.array(lip) + 8
    light = np.array(colour) + (255 - np.array(colour)) * 0.75
    paint = _mix(flesh, dark, 0.4 * (1 - depth) ** 2 + 0.3 * (np.abs(away) / 0.1) ** 4)
    paint = _mix(paint, light, 0.3 * np.exp(-(((depth - 0.7) / 0.16) ** 2) - ((away + 0.012) / 0.045) ** 2))
    return _texture(paint, 1.0)


def _flat_tip(colour: Colour) -> Texture:
    """Return the tip between the teeth in one colour, with one patch of light."""
    depth, x = _grid(24, 65)
    light = np.array(colour) + (255 - np.array(colour)) * 0.45
    patch = 1 - np.clip((((depth - 0.55) / 0.14) ** 2 + ((x * SPAN + 0.015) / 0.05) ** 2 - 1) / 0.5, 0, 1)
    return _texture(_mix(colour, light, patch), 1.0)


def _pucker(colour: Colour, deep: Colour) -> Texture:
    """Return the folds of protruded lips, from their outer edge to the hole, and the shade of their corners."""
    depth, x = _grid(24, 129)
    folds = np.abs(np.sin(np.pi * 6.5 * (np.abs(x) + 0.035 * np.sin(9 * x)))) ** 5 * (1 - x**4)
    strength = 0.1 * folds * np.sin(np.pi * np.clip(0.15 + 0.9 * depth, 0, 1)) * np.clip(np.abs(x) / 0.1, 0, 1)
    return _texture(_mix(colour, deep, 0.25 + 0 * depth * x), strength)


def _lip_shadow(colour: Colour) -> Texture:
    depth, _ = _grid(12, 1)
    return _texture(np.array(colour, dtype=np.float64)[None, None], 0.62 * (1 - depth) ** 1.6)


def _under_lip(colour: Colour, strength: float) -> Texture:
    depth, x = _grid(16, 33)
    soft = np.exp(-(((depth - 0.32) / 0.26) ** 2)) * (1 - depth) ** 0.5 * np.exp(-((x / 0.62) ** 2))
    return _texture(np.array(colour, dtype=np.float64)[None, None], strength * soft)


def _corners(colour: Colour) -> Texture:
    depth, x = _grid(15, 65)
    spot = np.exp(-(((depth - 0.5) / 0.2) ** 2) - ((np.abs(x) - 0.78) / 0.055) ** 2)
    return _texture(np.array(colour, dtype=np.float64)[None, None], 0.34 * spot)


def _fold(colour: Colour) -> Texture:
    """Return the fold from the nose to the corner of the mouth, from its upper end across to its lower end."""
    depth, x = _grid(15, 65)
    line = np.exp(-(((depth - 0.5) / 0.2) ** 2)) * np.clip((1 - np.abs(x)) / 0.5, 0, 1)
    return _texture(np.array(colour, dtype=np.float64)[None, None], 0.5 * line)


def _flat_fold(colour: Colour) -> Texture:
    depth, x = _grid(15, 65)
    line = (np.abs(depth - 0.5) < 0.17 * np.clip((1 - np.abs(x)) / 0.4, 0, 1)).astype(np.float64)
    return _texture(np.array(colour, dtype=np.float64)[None, None], 0.8 * line)
