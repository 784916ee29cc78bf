"""The eyes: lids, lashes, and an iris that moves."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.liveliness import CALM, UpperFace
from lipmotion_faces.kernels.painting import warp
from lipmotion_faces.portrait.design import WHITE, Design, Knots, Points, ellipse, open_curve, stroke
from lipmotion_faces.portrait.layer import Glow, Layer, Pixels, Rim, Window

LID_POSITIONS = 16
MOOD_LIDS = 8
"""Positions of the lids on the way to a mood."""
WIDE_RISE, SQUINT_RISE, SQUINT_FALL, LID_SLANT = 0.045, 0.055, 0.025, 0.045
"""How far a mood raises the upper lids, and the lower ones, and how far it then lowers the upper ones; how far lowered
brows take the inner half of the upper lids with them, and brows raised at their inner ends leave the outer half."""
CHEEK_SQUINT = 0.8
"""Raised cheeks narrow the eyes by this part."""
GAZE_STEPS = 8
"""Positions of the gaze in a pixel."""


class LidPose(NamedTuple):
    """The lids, and the furrows between them, in whole steps.

    shut : 0 (open) to ``LID_POSITIONS``
    wide, squint, slant, furrow, sneer : of a mood, 0 to ``MOOD_LIDS``; a negative slant lowers the outer half
    """

    shut: int
    wide: int = 0
    squint: int = 0
    slant: int = 0
    furrow: int = 0
    sneer: int = 0


def lid_pose(shut: float, mood: UpperFace) -> LidPose:
    """Return the nearest pose of lids that are closed so far, 0..1, in a mood."""
    slant = mood.lowered * (1 - mood.inner) - 0.8 * mood.inner * (1 - mood.outer) * (1 - mood.wide)
    furrow = mood.lowered * (1 - 0.5 * mood.inner)
    squint = max(mood.squint, CHEEK_SQUINT * mood.cheek)
    steps = (round(share * MOOD_LIDS) for share in (mood.wide, squint, slant, furrow, mood.sneer))
    return LidPose(round(shut * LID_POSITIONS), *steps)


class EyePainter:
    """Paints both eyes of a character, with the lids.

    lids : returns what is under the irises, the openings between the lids, and what is over the irises, by the pose of
           the lids
    """

    def __init__(self, design: Design, window: Window) -> None:
        self._design, self._window = design, window
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
        self.iris = layer.pixels
        self.lids = lru_cache(maxsize=2 * LID_POSITIONS)(self._paint_lids)
        self._cached = lru_cache(maxsize=128)(self._paint)

    def paint(self, shut: float, gaze_x: float, gaze_y: float, mood: UpperFace = CALM) -> Pixels:
        """Return the eyes, premultiplied colour and cover [shape=(h, w, 4)]; not to be changed.

        shut           : how far they are closed, 0..1
        gaze_x, gaze_y : how far the irises are to the right and down, in eye distances
        """
        step = self._window.view.scale * GAZE_STEPS
        return self._cached(lid_pose(shut, mood), round(gaze_x * step), round(gaze_y * step))

    def _paint(self, lids: LidPose, gaze_x: int, gaze_y: int) -> Pixels:
        under, almond, over = self.lids(lids)
        iris = np.empty_like(self.iris)
        grid = np.ones((2, 2))
        warp(self.iris, -gaze_x / GAZE_STEPS * grid, -gaze_y / GAZE_STEPS * grid, max(iris.shape[:2]), iris)
        iris *= almond[..., None]
        return over + (1 - over[..., 3:]) * (iris + (1 - iris[..., 3:]) * under)

    def _paint_lids(self, lids: LidPose) -> tuple[Pixels, NDArray[np.float32], Pixels]:
        """Return what is under the irises, the openings between the lids, and what is over the irises."""
        shut, design = lids.shut / LID_POSITIONS, self._design
        colours, eyes, flat = design.palette, design.eyes, design.flat
        upper, lower = _lid_edges(design, lids)
        highest = tuple(min(pair, key=lambda knot: knot[1]) for pair in zip(eyes.upper, upper, strict=True))
        under, almond, over = Layer(self._window), Layer(self._window), Layer(self._window)
        for side in (1, -1):
            flip, x = np.array([side, 1.0]), side * eyes.x
            top, bottom = open_curve(upper) * flip, open_curve(lower) * flip
            outline = np.vstack([open_curve(highest) * flip, (open_curve(eyes.lower) * flip)[::-1]])
            opening = np.vstack([top, bottom[::-1]])
            soft: tuple[Rim | Glow, ...] = ()
            ball: tuple[Rim | Glow, ...] = ()
            if not flat:
                soft = Rim(0.03, colours.skin_shade, 0.6), Glow(x, 0.0, 0.1, 0.05, colours.skin_light, 0.5)
                ball = Glow(x, -0.13, 0.2, 0.06, colours.eye_shade, 0.75), Rim(0.015, colours.skin_deep, 0.25)
            under.fill(outline, colours.skin, *soft)
            if shut < 0.92:
                under.fill(opening, colours.eye_white, *ball)
                almond.fill(opening, WHITE)
                if not flat:
                    corner = ellipse(side * 0.2, 0.028, 0.022, 0.016)
                    under.fill(corner, colours.eye_corner, within=opening, blur=0.004)
                    over.fill(ellipse(x, -0.12, 0.12, 0.05), colours.pupil, opacity=0.3, blur=0.02, within=opening)
            if not flat:
                over.fill(stroke(bottom, [0.004, 0.01, 0.014, 0.012]), colours.skin_deep, opacity=0.5, blur=0.004)
                ends = (*eyes.upper[1:-1], (eyes.upper[-1][0] + 0.02, -0.01))
                fold = open_curve([(x, min(y, -0.02) - 0.045 + 0.03 * shut) for x, y in ends]) * flip
                over.fill(stroke(fold, [0, 0.014, 0.012, 0]), colours.skin_deep, opacity=0.55, blur=0.006)
            widths = [eyes.lashes * width for width in (0.012, 0.03, 0.036, 0.034, 0.02)]
            over.fill(stroke(top, widths), colours.lashes)
            if flat:
                over.fill(stroke(bottom, [0.01] * 3), colours.lashes)
            elif eyes.lashes > 0.5:
                x, y = upper[-1]
                root_y = y + 0.35 * (upper[-2][1] - y)
                wing = open_curve([(x - 0.03, root_y), (x + 0.015, y - 0.012), (x + 0.046, y - 0.04)])
                over.fill(stroke(wing, [0.03, 0.02, 0]) * flip, colours.lashes)
            self._paint_furrows(over, lids, flip)
        return under.pixels, almond.pixels[..., 3], over.pixels

    def _paint_furrows(self, layer: Layer, lids: LidPose, flip: Points) -> None:
        """Paint the furrow beside the middle of lowered brows, and the wrinkles of the nose."""
        colours, flat = self._design.palette, self._design.flat
        colour, soft = (colours.line, 0.0) if flat else (colours.skin_deep, 0.006)
        if lids.furrow:
            line = stroke(open_curve([(0.05, -0.215), (0.042, -0.15), (0.055, -0.085)]), [0.0, 0.02, 0.0])
            layer.fill(line * flip, colour, opacity=0.75 * lids.furrow / MOOD_LIDS, blur=soft)
        if lids.sneer:
            for y in (-0.02, 0.045, 0.11):
                line = stroke(open_curve([(0.015, y), (0.06, y + 0.012), (0.105, y + 0.045)]), [0.008, 0.018, 0.0])
                layer.fill(line * flip, colour, opacity=0.65 * lids.sneer / MOOD_LIDS, blur=soft)


def _lid_edges(design: Design, lids: LidPose) -> tuple[Knots, Knots]:
    """Return the edges of the upper and the lower lid of the right eye."""
    shut, (wide, squint, slant, *_) = lids.shut / LID_POSITIONS, (steps / MOOD_LIDS for steps in lids[1:])
    upper, lower = design.eyes.upper, design.eyes.lower
    if lids[1:] != (0,) * len(lids[1:]):  # the corners stay
        bow = (0.0, 0.8, 1.0, 0.8, 0.0)
        half = (0.0, 1.0, 0.6, 0.15, 0.0) if slant > 0 else (0.0, 0.15, 0.6, 1.0, 0.0)
        moved = [
            (SQUINT_FALL * squint - WIDE_RISE * wide) * a + LID_SLANT * abs(slant) * b
            for a, b in zip(bow, half, strict=True)
        ]
        upper = tuple((x, y + by) for (x, y), by in zip(upper, moved, strict=True))
        lower = tuple((x, y - SQUINT_RISE * squint * share) for (x, y), share in zip(lower, bow, strict=True))
    return tuple((x, y + shut * (low - y)) for (x, y), (_, low) in zip(upper, lower, strict=True)), lower
