"""The still parts around the face: background, hair, ears, neck and shoulders."""

from __future__ import annotations

from lipmotion.faces.portrait import palette
from lipmotion.faces.portrait.head import HEAD
from lipmotion.faces.portrait.layer import Glow, Layer, Rim
from lipmotion.faces.portrait.outlines import (
    Points,
    both_sides,
    closed_curve,
    lowered,
    open_curve,
    path_points,
    stroke,
    symmetric,
)
from lipmotion.faces.portrait.view import Pixels, Window

NECK: Points = closed_curve(
    "-0.35 0.7, -0.35 1.2, -0.37 1.48, -0.6 1.72, -1.1 1.86, -1.1 2.6, 1.1 2.6, 1.1 1.86, 0.6 1.72, 0.37 1.48,"
    "0.35 1.2, 0.35 0.7"
)
SHOULDERS: Points = closed_curve(
    "-0.58 1.66, -0.9 1.74, -1.3 1.86, -1.62 2.1, -1.7 2.6, 1.7 2.6, 1.62 2.1, 1.3 1.86, 0.9 1.74, 0.58 1.66,"
    "0.42 1.85, 0.2 2, 0 2.04, -0.2 2, -0.42 1.85"
)
HAIR_BEHIND: Points = symmetric(
    "0 -1.06, 0.5 -0.98, 0.83 -0.62, 0.92 -0.1, 0.93 0.4, 0.99 0.9, 1.08 1.35, 1 1.7, 0.7 1.9, 0.3 1.85, 0 1.8"
)
HAIR_LEFT: Points = closed_curve(
    "-0.2 -0.98, -0.34 -1.05, -0.58 -0.97, -0.8 -0.72, -0.875 -0.3, -0.835 0.04, -0.765 0.25, -0.73 0.02,"
    "-0.68 -0.24, -0.52 -0.48, -0.32 -0.64, -0.22 -0.76"
)
HAIR_RIGHT: Points = closed_curve(
    "-0.24 -0.96, -0.1 -1.06, 0.2 -1.11, 0.58 -1, 0.82 -0.7, 0.885 -0.28, 0.84 0.04, 0.77 0.25, 0.735 0.03,"
    "0.69 -0.2, 0.54 -0.39, 0.24 -0.5, -0.04 -0.63, -0.2 -0.78"
)


def backdrop(window: Window) -> Pixels:
    """Return everything behind the head, opaque [shape=(h, w, 3)]."""
    layer = Layer(window)
    wall = path_points("-9 -9, 9 -9, 9 9, -9 9")
    layer.fill(wall, palette.WALL, Glow(-0.5, -0.5, 1.5, 1.6, palette.WALL_LIGHT, 0.9))
    _hair_behind(layer)
    _neck_and_shoulders(layer)
    _ears(layer)
    return layer.pixels[..., :3]


def hair(window: Window) -> Layer:
    """Return a layer with the hair in front of the forehead."""
    layer = Layer(window)
    for part, light_x in ((HAIR_LEFT, -0.52), (HAIR_RIGHT, 0.3)):
        layer.fill(lowered(part, 0.035), palette.SKIN_DEEP, opacity=0.4, blur=0.03, within=HEAD)
        light = Glow(light_x, -0.76, 0.25, 0.1, palette.HAIR_LIGHT, 0.75)
        layer.fill(part, palette.HAIR, Rim(0.07, palette.HAIR_DARK, 0.55), light)
    for lift in (0.05, 0.15, 0.24):
        line = open_curve(
            [(-0.19, -0.8 - 0.6 * lift), (0.12, -0.7 - lift), (0.48, -0.56 - lift), (0.76, -0.16 - 1.2 * lift)]
        )
        strand = stroke(line, [0, 0.02, 0.016, 0])
        layer.fill(strand, palette.HAIR_DARK, opacity=0.3, blur=0.006, within=HAIR_RIGHT)
    return layer


def chin_shadow(window: Window) -> Pixels:
    """Return the shadow of the head on what is behind it, 0..1 [shape=(h, w)]; the jaw is at rest."""
    layer = Layer(window)
    layer.fill(lowered(HEAD, 0.12), palette.SKIN_DEEP, opacity=0.55, blur=0.045)
    return layer.pixels[..., 3]


def shaded_neck(window: Window) -> Layer:
    """Return a layer with the neck in full shadow."""
    layer = Layer(window)
    layer.fill(NECK, palette.SKIN_DEEP)
    layer.cut(SHOULDERS)
    return layer


def _hair_behind(layer: Layer) -> None:
    lit = [Glow(side * 0.98, 1.1, 0.2, 0.75, palette.HAIR, 1.0) for side in (-1, 1)]
    gleam = Glow(-1.0, 1.2, 0.05, 0.3, palette.HAIR_LIGHT, 0.5)
    layer.fill(HAIR_BEHIND, palette.HAIR_DARK, *lit, gleam, Rim(0.04, palette.HAIR_DARK, 0.4))
    for inward in (0.05, 0.13, 0.2):
        line = open_curve(
            [(0.9 - inward, 0.5), (0.93 - inward, 0.95), (1 - 1.3 * inward, 1.35), (0.95 - 1.6 * inward, 1.7)]
        )
        for strand in both_sides(stroke(line, [0, 0.014, 0.018, 0])):
            layer.fill(strand, palette.HAIR_LIGHT, opacity=0.22, blur=0.006)


def _neck_and_shoulders(layer: Layer) -> None:
    layer.fill(NECK, palette.SKIN, Rim(0.1, palette.SKIN_SHADE, 0.7))
    for collarbone in both_sides(stroke(open_curve("0.1 1.93, 0.35 1.86, 0.62 1.84"), [0, 0.02, 0])):
        layer.fill(collarbone, palette.SKIN_SHADE, opacity=0.6, blur=0.01)
    layer.fill(lowered(SHOULDERS, -0.02), palette.SKIN_DEEP, opacity=0.3, blur=0.03, within=NECK)
    light = Glow(-0.9, 1.92, 0.35, 0.12, palette.CLOTH_LIGHT, 0.7)
    layer.fill(SHOULDERS, palette.CLOTH, Rim(0.1, palette.CLOTH_DARK, 0.8), light)


def _ears(layer: Layer) -> None:
    for ear in both_sides(closed_curve("0.7 0, 0.8 -0.07, 0.875 0, 0.87 0.17, 0.82 0.34, 0.77 0.42, 0.7 0.38")):
        layer.fill(ear, palette.SKIN, Rim(0.05, palette.SKIN_SHADE, 0.8))
    for hollow in both_sides(closed_curve("0.765 0.05, 0.81 0.01, 0.835 0.07, 0.825 0.17, 0.79 0.26, 0.765 0.2")):
        layer.fill(hollow, palette.SKIN_DEEP, opacity=0.5, blur=0.012)
    for ring in both_sides(closed_curve("0.775 0.42, 0.8 0.445, 0.775 0.47, 0.75 0.445")):
        layer.fill(ring, palette.GOLD, Glow(0, 0.43, 9, 0.015, palette.WHITE, 0.6))
