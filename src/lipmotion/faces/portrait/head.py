"""The head without eyes and mouth: skin, nose, brows."""

from __future__ import annotations

import numpy as np

from lipmotion.faces.portrait.design import Design
from lipmotion.faces.portrait.layer import Glow, Layer, Rim
from lipmotion.faces.portrait.outlines import Points, both_sides, ellipse, open_curve, stroke
from lipmotion.faces.portrait.palette import WHITE
from lipmotion.faces.portrait.view import Window


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
