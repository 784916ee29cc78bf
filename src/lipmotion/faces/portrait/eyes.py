"""The eyes: lids, lashes, and an iris that moves."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.portrait.design import Design
from lipmotion.faces.portrait.layer import Glow, Layer, Rim
from lipmotion.faces.portrait.outlines import Points, ellipse, mirrored, open_curve, stroke
from lipmotion.faces.portrait.palette import WHITE
from lipmotion.faces.portrait.view import Pixels, Window
from lipmotion.kernels.pixels.painting import warp

LID_POSITIONS = 16
GAZE_STEPS = 8
"""Positions of the gaze in a pixel."""


class EyePainter:
    """Paints both eyes of a character, with the lids.

    iris : the irises, looking straight ahead [shape=(h, w, 4)]
    lids : returns what is under the irises, the openings between the lids, and what is over the irises, by the position
           of the lids: 0 (open) to ``LID_POSITIONS``
    """

    def __init__(self, design: Design, window: Window) -> None:
        self._design, self._window = design, window
        self.iris = _iris(window, design).pixels
        self.lids = lru_cache(maxsize=LID_POSITIONS + 1)(self._painted_lids)
        self._cached = lru_cache(maxsize=128)(self._painted)

    def painted(self, shut: float, gaze_x: float, gaze_y: float) -> Pixels:
        """Return the eyes, premultiplied colour and cover [shape=(h, w, 4)]; not to be changed.

        shut           : how far they are closed, 0..1
        gaze_x, gaze_y : how far the irises are to the right and down, in eye distances
        """
        step = self._window.view.scale * GAZE_STEPS
        return self._cached(round(shut * LID_POSITIONS), round(gaze_x * step), round(gaze_y * step))

    def _painted(self, lids: int, gaze_x: int, gaze_y: int) -> Pixels:
        under, almond, over = self.lids(lids)
        iris = np.empty_like(self.iris)
        grid = np.ones((2, 2))
        step = max(iris.shape[:2])
        warp(self.iris, -gaze_x / GAZE_STEPS * grid, -gaze_y / GAZE_STEPS * grid, step, iris)
        iris *= almond[..., None]
        picture = iris + (1 - iris[..., 3:]) * under
        return over + (1 - over[..., 3:]) * picture

    def _painted_lids(self, position: int) -> tuple[Pixels, NDArray[np.float32], Pixels]:
        """Return what is under the irises, the openings between the lids, and what is over the irises."""
        shut, design, colours = position / LID_POSITIONS, self._design, self._design.palette
        under, almond, over = Layer(self._window), Layer(self._window), Layer(self._window)
        for side in (1, -1):
            whole, opening, bottom = _almonds(design, shut, side)
            light = Glow(side * design.eyes.x, 0.0, 0.1, 0.05, colours.skin_light, 0.5)
            soft = () if design.flat else (Rim(0.03, colours.skin_shade, 0.6), light)
            under.fill(whole, colours.skin, *soft)
            if shut < 0.92:
                x = side * design.eyes.x
                lid_shade = Glow(x, -0.13, 0.2, 0.06, colours.eye_shade, 0.75)
                ball = () if design.flat else (lid_shade, Rim(0.015, colours.skin_deep, 0.25))
                under.fill(opening, colours.eye_white, *ball)
                if not design.flat:
                    corner = ellipse(side * 0.2, 0.028, 0.022, 0.016)
                    under.fill(corner, colours.eye_corner, within=opening, blur=0.004)
                    over.fill(ellipse(x, -0.12, 0.12, 0.05), colours.pupil, opacity=0.3, blur=0.02, within=opening)
                almond.fill(opening, WHITE)
            if not design.flat:
                over.fill(stroke(bottom, [0.004, 0.01, 0.014, 0.012]), colours.skin_deep, opacity=0.5, blur=0.004)
            _crease(over, design, shut, side)
            _lashes(over, design, shut, side)
        return under.pixels, almond.pixels[..., 3], over.pixels


def _upper_lid(design: Design, shut: float) -> list[tuple[float, float]]:
    pairs = zip(design.eyes.upper, design.eyes.lower, strict=True)
    return [(x, y + shut * (low - y)) for (x, y), (_, low) in pairs]


def _on(side: int, curve: Points) -> Points:
    return curve if side == 1 else mirrored(curve)


def _almonds(design: Design, shut: float, side: int) -> tuple[Points, Points, Points]:
    """Return the outlines of the whole eye and of its opening, and the lower lid."""
    top, bottom = _on(side, open_curve(_upper_lid(design, shut))), _on(side, open_curve(design.eyes.lower))
    return np.vstack([_on(side, open_curve(design.eyes.upper)), bottom[::-1]]), np.vstack([top, bottom[::-1]]), bottom


def _crease(layer: Layer, design: Design, shut: float, side: int) -> None:
    if not design.flat:
        upper = design.eyes.upper
        fold = [(x, min(y, -0.02) - 0.045 + 0.03 * shut) for x, y in (*upper[1:-1], (upper[-1][0] + 0.02, -0.01))]
        crease = stroke(_on(side, open_curve(fold)), [0, 0.014, 0.012, 0])
        layer.fill(crease, design.palette.skin_deep, opacity=0.55, blur=0.006)


def _lashes(layer: Layer, design: Design, shut: float, side: int) -> None:
    lid, strength, colour = _upper_lid(design, shut), design.eyes.lashes, design.palette.lashes
    widths = [strength * width for width in (0.012, 0.03, 0.036, 0.034, 0.02)]
    layer.fill(stroke(_on(side, open_curve(lid)), widths), colour)
    if design.flat:
        layer.fill(stroke(_on(side, open_curve(design.eyes.lower)), [0.01] * 3), colour)
    if strength > 0.5 and not design.flat:
        x, y = lid[-1]
        root_y = y + 0.35 * (lid[-2][1] - y)
        wing = open_curve([(x - 0.03, root_y), (x + 0.015, y - 0.012), (x + 0.046, y - 0.04)])
        layer.fill(_on(side, stroke(wing, [0.03, 0.02, 0])), colour)


def _iris(window: Window, design: Design) -> Layer:
    """Return a layer with both irises, looking straight ahead; the lights on them move with them only a little."""
    layer, colours, eyes = Layer(window), design.palette, design.eyes
    y, r = eyes.y, eyes.iris
    for x in (eyes.x, -eyes.x):
        if design.flat:
            layer.fill(ellipse(x, y, r, r), colours.iris)
            layer.fill(ellipse(x, y, 0.6 * r, 0.6 * r), colours.pupil)
            layer.fill(ellipse(x - 0.3 * r, y - 0.35 * r, 0.28 * r, 0.28 * r), WHITE)
            continue
        light = Glow(x, y + 0.5 * r, 0.6 * r, 0.4 * r, colours.iris_light, 0.9)
        layer.fill(ellipse(x, y, r, r), colours.iris, Rim(0.16 * r, colours.iris_dark, 1.0), light)
        layer.fill(ellipse(x, y, 0.46 * r, 0.46 * r), colours.pupil)
        layer.fill(ellipse(x - 0.3 * r, y - 0.32 * r, 0.22 * r, 0.22 * r), WHITE, opacity=0.95)
        layer.fill(ellipse(x + 0.32 * r, y + 0.34 * r, 0.11 * r, 0.11 * r), WHITE, opacity=0.6)
    return layer
