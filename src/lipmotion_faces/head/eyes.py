"""Eyes: the skin around them, eyeballs, lashes and brows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import map_coordinates, spline_filter

from lipmotion_faces.head import palette, part
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
_UPPER_KNOTS = [(-0.75, 0.034), (-0.35, 0.071), (0.1, 0.083), (0.55, 0.073), (0.85, 0.045)]
_LOWER_KNOTS = [(-0.75, -0.053), (-0.3, -0.072), (0.15, -0.074), (0.6, -0.053), (0.85, -0.018)]
UPPER_LID, LOWER_LID = (
    np.asarray(CubicSpline(*np.array([(-1, -0.022), *knots, (1, 0.018)]).T)(LID_ACROSS))
    for knots in (_UPPER_KNOTS, _LOWER_KNOTS)
)
WIDE_RISE, SQUINT_RISE, SQUINT_FALL, SLANT = 0.034, 0.044, 0.018, 0.042
"""How far a mood raises the upper lid, raises the lower one and lowers the upper one, and how far lowered brows lower
the inner half of the upper lid, brows raised at their inner ends the outer half."""
LOWER_LID_RISE = 0.028  # how far the middle of the lower lid rises to meet the upper one


class Eyelids:
    """The skin around the left eye, rings that slide over the eyeball with the lids; the right eye's is mirrored."""

    def __init__(self) -> None:
        self._x = np.linspace(part.EYE[0] - 0.3, part.EYE[0] + 0.3, 61)
        self._y = np.linspace(-0.28, 0.3, 59)
        grid = np.meshgrid(self._x, self._y, indexing="ij")
        depth = part.find_front(grid[0].ravel(), grid[1].ravel()).reshape(grid[0].shape)
        self._depth = spline_filter(depth, order=3)

    def find_edge(self) -> Real:
        """Return the outermost ring, which never moves [shape=(LID_COLUMNS, 3)]."""
        angle = np.where(LID_SIDE > 0, np.arccos(LID_ACROSS), -np.arccos(LID_ACROSS))
        up = np.where(LID_SIDE > 0, _EDGE_UP, _EDGE_DOWN)
        return self._lift(part.EYE[0] + _EDGE_X * np.cos(angle), up * np.sin(angle))

    def place_opening(self, pose: CharacterPose) -> tuple[Real, Real]:
        """Return column and height of the edge of the lids [shape=(LID_COLUMNS,), both]."""
        gaze, bow, mood = 0.10 * pose.gaze[1], 1 - LID_ACROSS**2, pose.mood
        squint = 0.6 * max(pose.smile, 0.0)
        upper = UPPER_LID + gaze * bow + 0.15 * pose.brows * bow
        lower = LOWER_LID + (0.5 * gaze * (1 - pose.shut) + squint + LOWER_LID_RISE * pose.shut) * bow
        slant = mood.lowered * (1 - mood.inner) * np.clip(0.6 - LID_ACROSS, 0, 1)
        slant = slant + 0.7 * mood.inner * (1 - mood.outer) * (1 - mood.wide) * np.clip(0.6 + LID_ACROSS, 0, 1)
        upper = upper + (WIDE_RISE * mood.wide - SQUINT_FALL * mood.squint - SLANT * slant) * bow
        lower = lower + SQUINT_RISE * max(mood.squint, 0.7 * mood.cheek) * (1 - pose.shut) * bow
        upper = np.maximum(upper + min(1.12 * pose.shut, 1.0) * (lower - upper), lower)
        return part.EYE[0] + HALF_WIDTH * LID_ACROSS, np.where(LID_SIDE > 0, upper, lower)

    def place_rings(self, pose: CharacterPose) -> Real:
        """Return all rings but the outermost, from the eyeball outwards [shape=(LID_RINGS, LID_COLUMNS, 3)]."""
        x, y = self.place_opening(pose)
        edge = self.find_edge()
        share = (np.arange(LID_RINGS - 1) / (LID_RINGS - 1))[:, None] ** 1.25
        rings = self._lift((x + share * (edge[:, 0] - x)).ravel(), (y + share * (edge[:, 1] - y)).ravel())
        rings = rings.reshape(LID_RINGS - 1, LID_COLUMNS, 3)
        fold = np.exp(-(((share - 0.2) / 0.05) ** 2)) * np.where(LID_SIDE > 0, 1 - LID_ACROSS**2, 0) * (1 - pose.shut)
        rings[..., 2] -= 0.018 * fold
        away = rings[0] - part.EYE
        inner = part.EYE + away / np.linalg.norm(away, axis=1, keepdims=True) * (part.EYEBALL_RADIUS - 0.004)
        inner[:, 1] = rings[0][:, 1] + 0.1 * (inner[:, 1] - rings[0][:, 1])
        return np.concatenate([inner[None], rings])

    def _lift(self, x: Real, y: Real) -> Real:
        """Return the places of the skin at columns and heights [shape=(N, 3)]."""
        i = (x - self._x[0]) / (self._x[1] - self._x[0])
        j = (y - self._y[0]) / (self._y[1] - self._y[0])
        z = map_coordinates(self._depth, np.stack([i, j]), order=3, mode="nearest", prefilter=False)
        return np.stack([x, y, z], axis=1)


IRIS, PUPIL = 0.115, 0.055  # radii of iris and pupil, as lengths on the eyeball
CATCHLIGHT = 2.2  # reflections of lamps are brighter than white paint
_SIDES = 48
LASHES = 33  # columns of the lashes: those of the upper lid


def make_eyeball() -> part.Part:
    """Return the left eyeball, its middle at (0, 0, 0), looking along +z."""
    inner = [0, 0.022, PUPIL - 0.004, PUPIL, 0.068, 0.083, 0.098, IRIS - 0.006, IRIS, IRIS + 0.006, 0.138]
    radii = np.array([*inner, 0.162, 0.19, 0.215])
    angle = np.arcsin(np.clip(radii / part.EYEBALL_RADIUS, 0, 0.999))
    angle = np.concatenate([angle, np.linspace(angle[-1] + 0.15, 2.0, 5)])
    around = 2 * np.pi * np.arange(_SIDES) / _SIDES
    dome = part.EYEBALL_RADIUS + 0.007 * np.maximum(1 - (np.concatenate([radii, np.full(5, 1.0)]) / 0.125) ** 2, 0)
    down = angle[:, None]
    across, up, forward = np.sin(down) * np.cos(around), np.sin(down) * np.sin(around), np.cos(down) * np.ones(_SIDES)
    ring = np.stack([across, up, forward], axis=-1)
    places = (dome[:, None, None] * ring).reshape(-1, 3)
    colours = np.zeros((len(angle), _SIDES, 3))
    ray = 0.5 + 0.25 * np.sin(7 * around) * np.sin(19 * around + 1) + 0.25 * np.sin(31 * around)
    lower = 0.5 - 0.5 * np.sin(around)
    for n, radius in enumerate([*radii, *[1.0] * 5]):
        if radius <= PUPIL - 0.004:
            colours[n] = palette.PUPIL
        elif radius <= IRIS - 0.006:
            depth = (radius - PUPIL) / (IRIS - PUPIL)
            light = np.clip(0.25 + 0.55 * lower + 0.25 * ray - 0.5 * (depth - 0.45) ** 2, 0, 1)[:, None]
            colours[n] = (1 - light) * np.array(palette.IRIS_DARK) + light * np.array(palette.IRIS_LIGHT)
            if depth > 0.7:
                colours[n] = 0.55 * colours[n] + 0.45 * np.array(palette.IRIS_RIM)
        elif radius <= IRIS:
            colours[n] = palette.IRIS_RIM
        else:
            colours[n] = palette.EYE_WHITE
    triangles = part.make_grid(len(angle), _SIDES, closed=True)
    return part.make_part("eye", places, triangles, colours.reshape(-1, 3), palette.EYE_FINISH)


def make_catchlights() -> part.Part:
    """Return the reflections of lamp and window in the left eye, its middle at (0, 0, 0)."""
    discs = []
    for (x, y), radius, white in (((-0.045, 0.05), 0.026, 1.0), ((0.038, -0.045), 0.012, 0.8)):
        around = 2 * np.pi * np.arange(16) / 16
        flat = np.concatenate([[[x, y]], np.stack([x + radius * np.cos(around), y + radius * np.sin(around)], axis=1)])
        away = part.EYEBALL_RADIUS + 0.010
        z = np.sqrt(away**2 - (flat**2).sum(axis=1))
        fan = np.stack([np.zeros(16, int), 1 + np.arange(16), 1 + (np.arange(16) + 1) % 16], axis=1).astype(np.int32)
        discs.append(part.make_part("light", np.column_stack([flat, z]), fan, (white, white, white), palette.GLOWING))
    lights = part.join("catchlights", discs)
    return replace(lights, colours=CATCHLIGHT * lights.colours)


def place_lashes(edge: Real, shut: float) -> Real:
    """Return the left lashes [shape=(3 * LASHES, 3)], a wedge along the lid's edge [shape=(LASHES, 3)]."""
    share = np.linspace(0, 1, LASHES)
    thick = 0.004 + 0.018 * np.sin(np.pi * (0.12 + 0.8 * share)) ** 0.7 * share**0.4
    length = (0.012 + 0.045 * share**1.5) * np.clip((1 - share) / 0.03 + 0.35, 0, 1)
    out = edge - part.EYE
    out = out / np.linalg.norm(out, axis=1, keepdims=True)
    sweep = np.stack([0.75 * share, (0.75 - 1.2 * shut) * np.ones(LASHES), 0.55 + 0 * share], axis=1)
    sweep /= np.linalg.norm(sweep, axis=1, keepdims=True)
    upper = edge + 0.004 * out + thick[:, None] * np.array([0.0, 0.62, 0.1])
    tip = upper + length[:, None] * sweep
    below = edge + 0.006 * out + np.array([0, -0.004, 0.0])
    return np.concatenate([tip, 0.5 * (upper + edge) + 0.012 * out, below])


def make_brow() -> part.Part:
    """Return the left brow."""
    share = np.linspace(0, 1, 30)
    x = 0.135 + 0.40 * share
    y = 0.279 + 0.006 * share + 0.026 * np.sin(np.pi * share**1.3)
    path = np.stack([x, y, part.find_front(x, y) + 0.004], axis=1)
    wide = 0.033 * np.clip(1.02 - share, 0.01, 1) ** 0.6 * np.clip(share / 0.4, 0.02, 1) ** 0.6
    upward = np.broadcast_to([0.25, 0.1, 1.0], path.shape)
    places, triangles, strands = part.make_tube(path, wide, 0.45 * wide + 0.006, upward, sides=12)
    return part.make_part("brow", places, triangles, palette.BROW, palette.BROW_FINISH, strands)


INNER_RISE, OUTER_RISE, LOWERED, TOGETHER = 0.12, 0.1, (0.1, 0.03), 0.055
"""How far a mood raises inner and outer ends of brows, lowers inner and outer ones, and draws them together."""


def shift_brow(places: Real, pose: CharacterPose) -> Real:
    """Return how a mood moves places of a brow at rest [shape=(N, 3)]."""
    outwards = np.clip((np.abs(places[:, 0]) - 0.135) / 0.4, 0, 1)
    inner = (1 - outwards) ** 1.5
    moved, mood = np.zeros_like(places), pose.mood
    moved[:, 1] = INNER_RISE * mood.inner * inner + OUTER_RISE * mood.outer * np.sin(0.72 * np.pi * outwards**1.3)
    moved[:, 1] -= mood.lowered * (LOWERED[0] * inner + LOWERED[1] * (1 - inner))
    moved[:, 0] = -TOGETHER * mood.lowered * np.sign(places[:, 0]) * (1 - outwards)
    return moved
