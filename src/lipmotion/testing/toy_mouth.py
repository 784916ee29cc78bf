"""Mouth pictures of the toy corpus: drawn lips of known opening and width."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.appearance.mouth_region import EYE_DISTANCE_PX, HEIGHT, WIDTH
from lipmotion.types import Motion

SKIN, LIPS, INSIDE = (206.0, 160.0, 141.0), (172.0, 84.0, 88.0), (58.0, 24.0, 30.0)
"""Colours, RGB."""
INNER_WIDTH = 0.8
"""Width of the inner lips, relative to the width of the mouth."""
SHADE = 0.15
"""Share by which the skin is darker at the lower edge of the picture."""
THINNEST_PX = 0.2


def toy_mouths(motion: Motion) -> NDArray[np.uint8]:
    """Return the mouth pictures [shape=(T, 56, 72, 3)] of the channels ``opening``, ``width`` and ``outer``."""
    opening, width, outer = (
        motion[name][:, None, None] * EYE_DISTANCE_PX / 2 for name in ("opening", "width", "outer")
    )
    shade = 1 - SHADE * np.arange(HEIGHT)[:, None, None] / HEIGHT
    picture = np.broadcast_to(np.array(SKIN) * shade, (len(motion.values), HEIGHT, WIDTH, 3))
    for colour, across, down in ((LIPS, width, outer), (INSIDE, INNER_WIDTH * width, opening)):
        share = _ellipse(across, down)[..., None]
        picture = (1 - share) * picture + share * np.array(colour)
    return np.rint(picture).astype(np.uint8)


def _ellipse(across: NDArray[np.float64], down: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the share of each pixel inside a centred ellipse [shape=(T, 56, 72)] of half axes [shape=(T, 1, 1)]."""
    x = np.arange(WIDTH)[None, None, :] + 0.5 - WIDTH / 2
    y = np.arange(HEIGHT)[None, :, None] + 0.5 - HEIGHT / 2
    across, down = np.maximum(across, THINNEST_PX), np.maximum(down, THINNEST_PX)
    radius = np.hypot(x / across, y / down)
    return np.clip(0.5 + (1 - radius) * np.minimum(across, down), 0, 1)
