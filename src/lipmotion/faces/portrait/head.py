"""The head without eyes and mouth: skin, nose, brows."""

from __future__ import annotations

from lipmotion.faces.portrait import palette
from lipmotion.faces.portrait.layer import Glow, Layer, Rim
from lipmotion.faces.portrait.outlines import Points, both_sides, ellipse, open_curve, stroke, symmetric
from lipmotion.faces.portrait.view import Window

HEAD: Points = symmetric(
    "0 -0.93, 0.36 -0.86, 0.63 -0.6, 0.745 -0.2, 0.755 0.2, 0.725 0.55, 0.635 0.9, 0.45 1.19, 0.22 1.35, 0 1.39"
)


def paint_head(window: Window) -> Layer:
    """Return a layer with the bald head without eyes and mouth."""
    layer = Layer(window)
    layer.fill(HEAD, palette.SKIN, Rim(0.16, palette.SKIN_SHADE, 0.62), *_light_and_shade())
    _nose(layer)
    _philtrum(layer)
    for brow in both_sides(
        stroke(open_curve("0.145 -0.245, 0.27 -0.275, 0.42 -0.295, 0.575 -0.225"), [0.03, 0.058, 0.056, 0.045, 0.006])
    ):
        layer.fill(brow, palette.HAIR, opacity=0.92, blur=0.007)
    return layer


def _light_and_shade() -> list[Glow]:
    forehead = Glow(-0.05, -0.35, 0.5, 0.35, palette.SKIN_LIGHT, 0.55)
    chin = Glow(0.0, 1.24, 0.16, 0.09, palette.SKIN_LIGHT, 0.45)
    glows = [forehead, chin]
    for side in (-1, 1):
        glows += [
            Glow(side * 0.43, 0.54, 0.23, 0.18, palette.BLUSH, 0.34),
            Glow(side * 0.36, 0.30, 0.2, 0.1, palette.SKIN_LIGHT, 0.5),
            Glow(side * 0.34, -0.08, 0.24, 0.12, palette.SKIN_SHADE, 0.38),
        ]
    return glows


def _nose(layer: Layer) -> None:
    layer.fill(ellipse(0, 0.61, 0.19, 0.06), palette.SKIN_SHADE, opacity=0.75, blur=0.03)
    layer.fill(ellipse(0, 0.545, 0.13, 0.075), palette.SKIN_LIGHT, opacity=0.7, blur=0.04)
    sides = both_sides(stroke(open_curve("0.125 -0.1, 0.085 0.12, 0.1 0.36"), [0.03, 0.05, 0.02]))
    for bridge, opacity in zip(sides, (0.45, 0.25), strict=True):
        layer.fill(bridge, palette.SKIN_SHADE, opacity=opacity, blur=0.025)
    for wing in both_sides(stroke(open_curve("0.155 0.5, 0.195 0.57, 0.165 0.635"), [0, 0.022, 0])):
        layer.fill(wing, palette.SKIN_DEEP, opacity=0.6, blur=0.008)
    for nostril in both_sides(stroke(open_curve("0.035 0.632, 0.085 0.615, 0.135 0.632"), [0, 0.034, 0])):
        layer.fill(nostril, palette.SKIN_DEEP, opacity=0.9, blur=0.005)
    base = stroke(open_curve("-0.04 0.645, 0 0.655, 0.04 0.645"), [0, 0.012, 0])
    layer.fill(base, palette.SKIN_DEEP, opacity=0.5, blur=0.006)
    layer.fill(ellipse(-0.02, 0.3, 0.03, 0.2), palette.SKIN_LIGHT, opacity=0.6, blur=0.03)
    layer.fill(ellipse(-0.02, 0.545, 0.035, 0.022), palette.WHITE, opacity=0.45, blur=0.015)


def _philtrum(layer: Layer) -> None:
    layer.fill(ellipse(0, 0.745, 0.028, 0.06), palette.SKIN_SHADE, opacity=0.4, blur=0.02)
    for ridge in both_sides(ellipse(0.052, 0.76, 0.014, 0.05)):
        layer.fill(ridge, palette.SKIN_LIGHT, opacity=0.5, blur=0.016)
