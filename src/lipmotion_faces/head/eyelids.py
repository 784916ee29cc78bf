"""The skin around the eyes: a patch of rings about each eye that slides over the eyeball when the lids move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import map_coordinates, spline_filter

from lipmotion_faces.head.forms import EYE, EYEBALL_RADIUS, head, seen_from_front
from lipmotion_faces.head.pose import CharacterPose

Real = NDArray[np.float64]

_UPPER_COLUMNS = 33
LID_COLUMNS = 2 * _UPPER_COLUMNS - 2
LID_RINGS = 11
"""Rings from the edge of the lids (after the first ring, which touches the eyeball) to the skin of the face."""
HALF_WIDTH = 0.187
_EDGE_X = 0.268
_EDGE_UP, _EDGE_DOWN = 0.25, 0.215
_ACROSS = np.sin(np.linspace(-np.pi / 2, np.pi / 2, _UPPER_COLUMNS))
LID_ACROSS: Real = np.concatenate([_ACROSS, _ACROSS[-2:0:-1]])
"""Place of every column between the inner corner (-1) and the outer one (1)."""
LID_SIDE: Real = np.concatenate([np.ones(_UPPER_COLUMNS), -np.ones(_UPPER_COLUMNS - 2)])
"""1 on the upper lid, -1 on the lower lid."""


def _curve(knots: list[tuple[float, float]]) -> Real:
    x, y = np.array(knots).T
    return np.asarray(CubicSpline(x, y)(LID_ACROSS))


UPPER_LID = _curve(
    [(-1, -0.022), (-0.75, 0.034), (-0.35, 0.071), (0.1, 0.083), (0.55, 0.073), (0.85, 0.045), (1, 0.018)]
)
LOWER_LID = _curve(
    [(-1, -0.022), (-0.75, -0.053), (-0.3, -0.072), (0.15, -0.074), (0.6, -0.053), (0.85, -0.018), (1, 0.018)]
)
WIDE_RISE, SQUINT_RISE, SQUINT_FALL, SLANT = 0.034, 0.044, 0.018, 0.042
"""How far a mood raises the upper lid, raises the lower one and lowers the upper one, and how far lowered brows lower
the inner half of the upper lid, brows raised at their inner ends the outer half."""
LOWER_LID_RISE = 0.028
"""How far the middle of the lower lid rises to meet the upper one."""


class Eyelids:
    """The lids of the left eye; those of the right eye are their mirror image."""

    def __init__(self) -> None:
        self._x = np.linspace(EYE[0] - 0.3, EYE[0] + 0.3, 61)
        self._y = np.linspace(-0.28, 0.3, 59)
        grid = np.meshgrid(self._x, self._y, indexing="ij")
        depth = seen_from_front(head, grid[0].ravel(), grid[1].ravel()).reshape(grid[0].shape)
        self._depth = spline_filter(depth, order=3)

    def edge(self) -> Real:
        """Return the outermost ring, which never moves [shape=(LID_COLUMNS, 3)]."""
        angle = np.where(LID_SIDE > 0, np.arccos(LID_ACROSS), -np.arccos(LID_ACROSS))
        up = np.where(LID_SIDE > 0, _EDGE_UP, _EDGE_DOWN)
        return self._lifted(EYE[0] + _EDGE_X * np.cos(angle), up * np.sin(angle))

    def opening(self, pose: CharacterPose) -> tuple[Real, Real]:
        """Return column and height of the edge of the lids [shape=(LID_COLUMNS,), both]."""
        gaze = 0.10 * pose.gaze[1]
        squint = 0.6 * max(pose.smile, 0.0)
        upper = UPPER_LID + gaze * (1 - LID_ACROSS**2) + 0.15 * pose.brows * (1 - LID_ACROSS**2)
        lower = LOWER_LID + (0.5 * gaze * (1 - pose.shut) + squint + LOWER_LID_RISE * pose.shut) * (1 - LID_ACROSS**2)
        bow = 1 - LID_ACROSS**2
        mood = pose.mood
        slant = mood.lowered * (1 - mood.inner) * np.clip(0.6 - LID_ACROSS, 0, 1)
        slant = slant + 0.7 * mood.inner * (1 - mood.outer) * (1 - mood.wide) * np.clip(0.6 + LID_ACROSS, 0, 1)
        upper = upper + (WIDE_RISE * mood.wide - SQUINT_FALL * mood.squint - SLANT * slant) * bow
        lower = lower + SQUINT_RISE * max(mood.squint, 0.7 * mood.cheek) * (1 - pose.shut) * bow
        upper = np.maximum(upper + min(1.12 * pose.shut, 1.0) * (lower - upper), lower)
        return EYE[0] + HALF_WIDTH * LID_ACROSS, np.where(LID_SIDE > 0, upper, lower)

    def rings(self, pose: CharacterPose) -> Real:
        """Return all rings but the outermost, from the eyeball outwards [shape=(LID_RINGS, LID_COLUMNS, 3)]."""
        x, y = self.opening(pose)
        edge = self.edge()
        share = (np.arange(LID_RINGS - 1) / (LID_RINGS - 1))[:, None] ** 1.25
        rings = self._lifted((x + share * (edge[:, 0] - x)).ravel(), (y + share * (edge[:, 1] - y)).ravel())
        rings = rings.reshape(LID_RINGS - 1, LID_COLUMNS, 3)
        fold = np.exp(-(((share - 0.2) / 0.05) ** 2)) * np.where(LID_SIDE > 0, 1 - LID_ACROSS**2, 0) * (1 - pose.shut)
        rings[..., 2] -= 0.018 * fold
        away = rings[0] - EYE
        inner = EYE + away / np.linalg.norm(away, axis=1, keepdims=True) * (EYEBALL_RADIUS - 0.004)
        inner[:, 1] = rings[0][:, 1] + 0.1 * (inner[:, 1] - rings[0][:, 1])
        return np.concatenate([inner[None], rings])

    def _lifted(self, x: Real, y: Real) -> Real:
        """Return the places of the skin at columns and heights [shape=(N, 3)]."""
        i = (x - self._x[0]) / (self._x[1] - self._x[0])
        j = (y - self._y[0]) / (self._y[1] - self._y[0])
        z = map_coordinates(self._depth, np.stack([i, j]), order=3, mode="nearest", prefilter=False)
        return np.stack([x, y, z], axis=1)
