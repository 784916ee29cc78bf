"""How the picture moves: shifts of skin with jaw, lips and brows, and of the whole head.

A shift says, for places of the picture, how far away the place is whose pixel is shown there; in eye distances.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import smooth_step
from lipmotion.articulation.liveliness import CALM, UpperFace
from lipmotion_faces.portrait.design import LipDesign
from lipmotion_faces.portrait.geometry import MouthPose
from lipmotion_faces.portrait.layer import Window

Floats = NDArray[np.float64]

STEP = 8
"""Shifts are computed at every eighth pixel and interpolated between."""
JAW_TOP, CHIN = -0.24, 0.4
"""Between these heights, from the line of the lips, skin is stretched when the jaw drops; below, it moves with it."""
PIVOT_Y = 1.35
"""The head rolls about this point of the neck."""
BROW_STEPS = 8
"""Positions of raised brows in a pixel."""
MOOD_STEPS = 24
"""Positions of the brows on the way to a mood."""
INNER_RISE, OUTER_RISE, LOWERED, TOGETHER = 0.13, 0.1, (0.115, 0.05), 0.06
"""How far a mood raises the inner and the outer ends of the brows, lowers the inner ends, and outer ones, and draws
them together."""
NOSE_LIFT, CHEEK_LIFT = 0.05, 0.06
"""How far wrinkling lifts the wings of the nose, and a smile the cheeks."""
NECK_TOP, NECK_END = 1.15, 1.85
"""Between these heights the movement of the head fades."""


class HeadPlacement(NamedTuple):
    """Where the head is: shifts in eye distances, to the right and down; angles in radians.

    roll  : to the speaker's left shoulder, clockwise in the picture
    yaw   : features move to the right against the outline of the head
    pitch : features move down against it: nodding
    """

    x: float = 0.0
    y: float = 0.0
    roll: float = 0.0
    yaw: float = 0.0
    pitch: float = 0.0


class SkinField:
    """Shifts of the skin below the eyes by a pose of the mouth, over a window."""

    def __init__(self, window: Window, lips: LipDesign) -> None:
        x, y = grid(window)
        self._scale = window.view.scale
        low = y - lips.line_y
        self._jaw = smooth_step((low - JAW_TOP) / (CHIN - JAW_TOP))
        side = np.abs(x)
        self._cheek = -np.sign(x) * np.exp(-(((side - 1.25 * lips.half_width) / 0.2) ** 2) - (low / 0.24) ** 2)
        self._narrow = -x * np.clip((low - 0.1) / 0.3, 0, 1) * (1 - 0.5 * np.clip(side / 0.7, 0, 1))
        self._lift = np.exp(-(((side - 0.42) / 0.22) ** 2) - ((low + 0.2) / 0.18) ** 2)
        self._lift *= np.clip((low + 0.5) / 0.2, 0, 1)
        self._nose = np.exp(-((side / 0.26) ** 4) - ((low + 0.29) / 0.17) ** 4) * np.clip((low + 0.5) / 0.08, 0, 1)
        self._half_width = lips.half_width

    def shifts(self, pose: MouthPose, mood: UpperFace = CALM) -> tuple[Floats, Floats]:
        """Return the shifts to the right and down, in pixels: to the place that is shown."""
        pulled = np.clip(pose.width - 1, -0.5, 0.3) * self._half_width
        jaw = np.clip(pose.jaw, 0, 0.5)
        x = 0.55 * pulled * self._cheek - 0.1 * jaw * self._narrow
        y = -jaw * self._jaw + 0.05 * np.clip(pose.spread, 0, 1) * self._lift * 0.5
        if mood is not CALM:
            y = y + CHEEK_LIFT * mood.cheek * self._lift + NOSE_LIFT * mood.sneer * self._nose
        return x * self._scale, y * self._scale


class BrowPose(NamedTuple):
    """The brows in whole steps: raised by ``BROW_STEPS`` a pixel, and by a mood in ``MOOD_STEPS``."""

    raised: int
    inner: int = 0
    outer: int = 0
    lowered: int = 0


def brow_pose(raised: float, mood: UpperFace, scale: float) -> BrowPose:
    """Return the nearest pose of brows that are raised by a length in eye distances; ``scale``: pixels in one."""
    of_mood = (round(share * MOOD_STEPS) for share in (mood.inner, mood.outer, mood.lowered))
    return BrowPose(round(raised * BROW_STEPS * scale), *of_mood)


class BrowField:
    """Shifts of the skin of the forehead by raised or lowered brows, over a window."""

    def __init__(self, window: Window) -> None:
        x, y = grid(window)
        self._scale = window.view.scale
        fade = np.clip((-0.1 - y) / 0.07, 0, 1) * np.clip((y + 0.62) / 0.2, 0, 1)
        bump = fade * np.exp(-(((np.abs(x) - 0.36) / 0.34) ** 4))
        self._both = bump
        outwards = np.clip((np.abs(x) - 0.13) / 0.45, 0, 1)
        self._inner, self._outer = (1 - outwards) ** 1.5, np.sin(np.pi * outwards**1.3 * 0.72)
        self._inwards = np.sign(x) * (1 - outwards) * fade * np.clip(np.abs(x) / 0.1, 0, 1)

    def shifts(self, brows: BrowPose) -> tuple[Floats, Floats]:
        """Return the shifts to the right and down, in pixels: to the place that is shown."""
        y = brows.raised / (BROW_STEPS * self._scale) * self._both * self._scale
        if brows == (brows.raised, 0, 0, 0):
            return np.zeros_like(y), y
        inner, outer, lowered = (steps / MOOD_STEPS for steps in brows[1:])
        rise = INNER_RISE * inner * self._inner + OUTER_RISE * outer * self._outer
        rise = rise - lowered * (LOWERED[0] * self._inner + LOWERED[1] * (1 - self._inner))
        return TOGETHER * lowered * self._inwards * self._scale, y + rise * self._both * self._scale


class HeadField:
    """Shifts of the whole picture by a pose of the head, over a window."""

    def __init__(self, window: Window) -> None:
        x, y = grid(window)
        self._scale, self._x, self._y = window.view.scale, x, y
        self._with_head = smooth_step((NECK_END - y) / (NECK_END - NECK_TOP))
        self._features = np.exp(-((x / 0.62) ** 2) - (((y - 0.35) / 0.85) ** 2)) * self._with_head

    def shifts(self, pose: HeadPlacement) -> tuple[Floats, Floats]:
        """Return the shifts to the right and down, in pixels."""
        x = self._with_head * (pose.x - pose.roll * (self._y - PIVOT_Y)) + pose.yaw * self._features
        y = self._with_head * (pose.y + pose.roll * self._x) + pose.pitch * self._features
        return -x * self._scale, -y * self._scale


def grid(window: Window) -> tuple[Floats, Floats]:
    """Return x and y of every ``STEP``-th pixel of a window, in eye distances [shapes=(h, w)]."""
    columns = np.arange(0, window.x1 - window.x0 + STEP, STEP) + window.x0 + 0.5
    rows = np.arange(0, window.y1 - window.y0 + STEP, STEP) + window.y0 + 0.5
    x, y = (columns - window.view.origin[0]) / window.view.scale, (rows - window.view.origin[1]) / window.view.scale
    return np.broadcast_to(x, (len(y), len(x))), np.broadcast_to(y[:, None], (len(y), len(x)))
