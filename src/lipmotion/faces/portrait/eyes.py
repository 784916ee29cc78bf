"""The eyes, and the times at which they blink."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.portrait import palette
from lipmotion.faces.portrait.layer import Glow, Layer, Rim
from lipmotion.faces.portrait.outlines import Points, ellipse, mirrored, open_curve, stroke
from lipmotion.faces.portrait.view import Window

BLINK_S = 0.2
"""Duration of a blink."""
CENTRE_X, CENTRE_Y = 0.345, -0.014
LOWER_LID = ((0.175, 0.035), (0.26, 0.075), (0.37, 0.088), (0.465, 0.05), (0.51, -0.01))
UPPER_LID = ((0.175, 0.035), (0.245, -0.062), (0.35, -0.106), (0.455, -0.082), (0.51, -0.01))


def lid_closure(time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far the eyes are closed at each time, 0..1 [shape=(T,)].

    Blinks are always at the same times, about 2.9 to 4.5 s apart; the lids fall faster than they rise.
    """
    number = np.arange(1, int(np.max(time_s, initial=0) / 2.8) + 3)
    blink_s = 3.7 * number - 1.6 + 0.45 * np.sin(2.4 * number)
    share = (time_s[:, None] - blink_s) / BLINK_S
    shut = np.where(share < 0.4, share / 0.4, (1 - share) / 0.6)
    return np.asarray(np.sin(np.clip(shut, 0, 1).max(axis=1) * np.pi / 2))


def paint_eyes(window: Window, shut: float) -> Layer:
    """Return a layer with both eyes.

    shut : how far they are closed, 0..1
    """
    layer = Layer(window)
    for side in (1, -1):
        _lids(layer, shut, side)
        _lashes(layer, shut, side)
    return layer


def _upper_lid(shut: float) -> list[tuple[float, float]]:
    return [(x, y + shut * (low - y)) for (x, y), (_, low) in zip(UPPER_LID, LOWER_LID, strict=True)]


def _on(side: int, curve: Points) -> Points:
    return curve if side == 1 else mirrored(curve)


def _lids(layer: Layer, shut: float, side: int) -> None:
    top, bottom = _on(side, open_curve(_upper_lid(shut))), _on(side, open_curve(LOWER_LID))
    skin = np.vstack([_on(side, open_curve(UPPER_LID)), bottom[::-1]])
    light = Glow(side * CENTRE_X, 0.0, 0.1, 0.05, palette.SKIN_LIGHT, 0.5)
    layer.fill(skin, palette.SKIN, Rim(0.03, palette.SKIN_SHADE, 0.6), light)
    if shut < 0.9:
        _ball(layer, np.vstack([top, bottom[::-1]]), side)
    rim = stroke(bottom, [0.004, 0.01, 0.014, 0.012])
    layer.fill(rim, palette.SKIN_DEEP, opacity=0.5, blur=0.004)
    fold = [(x, min(y, -0.02) - 0.045 + 0.03 * shut) for x, y in (*UPPER_LID[1:-1], (0.53, -0.01))]
    crease = stroke(_on(side, open_curve(fold)), [0, 0.014, 0.012, 0])
    layer.fill(crease, palette.SKIN_DEEP, opacity=0.55, blur=0.006)


def _lashes(layer: Layer, shut: float, side: int) -> None:
    lid = _upper_lid(shut)
    layer.fill(stroke(_on(side, open_curve(lid)), [0.012, 0.03, 0.036, 0.034, 0.02]), palette.HAIR_DARK)
    root_y = lid[-1][1] + 0.35 * (lid[-2][1] - lid[-1][1])
    wing = open_curve([(0.48, root_y), (0.525, -0.022), (0.556, -0.05)])
    layer.fill(_on(side, stroke(wing, [0.03, 0.02, 0])), palette.HAIR_DARK)


def _ball(layer: Layer, almond: Points, side: int) -> None:
    x, y = side * CENTRE_X, CENTRE_Y
    lid_shade = Glow(x, -0.13, 0.2, 0.06, palette.EYE_SHADE, 0.75)
    layer.fill(almond, palette.EYE_WHITE, lid_shade, Rim(0.015, palette.SKIN_DEEP, 0.25))
    layer.fill(ellipse(side * 0.2, 0.028, 0.022, 0.016), palette.EYE_CORNER, within=almond, blur=0.004)
    light = Glow(x, y + 0.05, 0.06, 0.04, palette.IRIS_LIGHT, 0.9)
    layer.fill(ellipse(x, y, 0.1, 0.1), palette.IRIS, Rim(0.016, palette.IRIS_DARK, 1.0), light, within=almond)
    layer.fill(ellipse(x, y, 0.046, 0.046), palette.PUPIL, within=almond)
    layer.fill(ellipse(x, -0.12, 0.12, 0.05), palette.PUPIL, opacity=0.3, blur=0.02, within=almond)
    layer.fill(ellipse(x - 0.03, y - 0.032, 0.022, 0.022), palette.WHITE, opacity=0.95, within=almond)
    layer.fill(ellipse(x + 0.032, y + 0.034, 0.011, 0.011), palette.WHITE, opacity=0.6, within=almond)
