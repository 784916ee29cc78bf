"""Colours of the skin: cheeks, nose, nostrils, lips and lids."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.head import palette
from lipmotion.faces.head.eyelids import LID_SIDE
from lipmotion.faces.head.lips import ACROSS, VISIBLE_RINGS
from lipmotion.faces.head.skin import Skin
from lipmotion.meshes.rendering.lighting import linear

Real = NDArray[np.float64]
CORNER_FADE_SHARE = 0.4
"""How far the colour of the lips fades to that of the skin towards the corners."""


def skin_colours(skin: Skin) -> Real:
    """Return the diffuse reflection of all vertices of the skin, linear [shape=(V, 3)]."""
    x, y, z = np.abs(skin.rest[:, 0]), skin.rest[:, 1], skin.rest[:, 2]
    colour = np.broadcast_to(np.array(palette.SKIN), skin.rest.shape).copy()

    def tint(strength: float, middle: tuple[float, float], radii: tuple[float, float], wanted: palette.Triple) -> None:
        spot = np.exp(-(((x - middle[0]) / radii[0]) ** 2) - ((y - middle[1]) / radii[1]) ** 2)
        share = strength * spot[:, None] * (z > -0.85)[:, None]
        colour[:] = (1 - share) * colour + share * np.array(wanted)

    tint(0.5, (0, 0.45), (0.5, 0.3), palette.SKIN_LIGHT)
    tint(0.4, (0.44, -0.36), (0.21, 0.15), palette.BLUSH)
    tint(0.25, (0, -0.40), (0.12, 0.09), palette.BLUSH)
    tint(0.12, (0, -1.05), (0.15, 0.1), palette.BLUSH)
    tint(0.25, (0.33, 0.17), (0.2, 0.06), palette.BLUSH)
    tint(0.8, (0.055, -0.495), (0.028, 0.018), palette.SKIN_DEEP)
    _lips(skin, colour)
    for eye in range(2):
        lids = skin.lid_rows(eye)
        colour[lids[0]] = palette.EYE_CORNER
        colour[lids[1]] = 0.5 * np.array(palette.EYE_CORNER) + 0.5 * np.array(palette.SKIN)
        for ring, share in ((2, 0.12), (3, 0.30), (4, 0.12)):
            upper = lids[ring, LID_SIDE > 0]
            colour[upper] = (1 - share) * np.array(palette.SKIN) + share * np.array(palette.SKIN_DEEP)
    return linear(colour)


def _lips(skin: Skin, colour: Real) -> None:
    lips = skin.lip_rows()
    bare = colour[lips[0]]
    colour[lips[1]] = 0.45 * colour[lips[1]] + 0.55 * np.array(palette.LIP)
    colour[lips[2 : VISIBLE_RINGS - 1].ravel()] = palette.LIP
    for ring in range(VISIBLE_RINGS - 2, VISIBLE_RINGS + 1):
        share = 0.3 * (ring - VISIBLE_RINGS + 3)
        colour[lips[ring]] = (1 - share) * np.array(palette.LIP) + share * np.array(palette.LIP_DEEP)
    faded = (CORNER_FADE_SHARE * np.clip((np.abs(ACROSS) - 0.8) / 0.2, 0, 1) ** 2)[:, None]
    colour[lips[1:VISIBLE_RINGS]] += faded * (bare - colour[lips[1:VISIBLE_RINGS]])
    colour[lips[VISIBLE_RINGS + 1 :].ravel()] = palette.MOUTH
