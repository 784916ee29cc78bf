"""The lips of one pose: contours from the motion, a rounded cross-section at every column of them.

The lips are a closed loop of ``COLUMNS`` columns: the upper lip from the right corner to the left one, then the lower
lip back. Every column runs through ``RINGS`` rings: from the skin over the lip into the mouth, and on along the wall of
the mouth to the throat.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from lipmotion.articulation.contact import LEAST_GAP, smooth_step
from lipmotion_faces.head.part import MOUTH_Y
from lipmotion_faces.head.pose import CharacterPose

Real = NDArray[np.float64]

_UPPER_COLUMNS = 41
COLUMNS = 2 * _UPPER_COLUMNS - 2
REST_HALF_WIDTH = 0.268
TEETH_Z = -0.055
"""Front of the incisors."""
TEETH_EDGE = MOUTH_Y - 0.017
"""Height of the edge of the upper incisors; they belong to the skull."""
ARCH = 1.15
"""Curvature of lips and teeth seen from above: how far they lie back, over x squared."""
_UPPER_LIP, _LOWER_LIP = 0.076, 0.106
OVAL_SQUEEZE = 0.14
"""How much nearer to the middle the inner edge of an oval mouth lies than the corners."""
HOLE_WIDTH = (0.014, 0.6)
"""Half the width of a round hole, round which the lips run as a ring: a length, and so much of the gap."""
RING_GAP, LINE_SHARE = 0.01, 0.25
"""Below this gap the hole of round lips widens to a line, by so much: more, and sums of blendshapes fit worse."""
ROUND_BOW = 0.0012
"""How far the middle of a round hole is raised: its middle lies before its sides, and the camera looks down on it."""
SEAM_GAP, SEAM_FORWARD = 0.03, 0.026
"""Below this gap the seam of the lips comes forward, at most so far: the crease between closed lips is shallow."""
ROUND_DROP = 0.025
"""How far the line between round lips sinks: the upper lip hides the teeth."""
REST_SMILE, SMILE_GAP = 0.027, 0.05
"""How far the corners rise at rest; parted, pressed and round lips do not smile, from this gap on. Tucked ones do: with
lower corners, teeth on the lip look like contempt."""
BITTEN_EDGE_Y = TEETH_EDGE + 0.017
"""Height of the edge of the lower lip on the upper teeth."""
_KNOTS = np.array([0, 0.22, 0.5, 0.72, 0.88, 0.98, 1.12, 1.4])
_AT = np.array([0.0, 0.09, 0.2, 0.31, 0.41, 0.5, 0.58, 0.66, 0.74, 0.81, 0.88, 0.94, 1.0, 1.12, 1.4])
_SECTION: Real = np.asarray(CubicSpline(_KNOTS, np.eye(len(_KNOTS)))(_AT))
_WALL = ((0.10, -0.16), (0.26, -0.30), (0.7, -0.40), (1.0, -0.42))
"""Rings behind the lips: how far towards the middle of the throat, and how far back."""
RINGS = len(_AT) + len(_WALL)
VISIBLE_RINGS = 11
"""Rings up to this one can be seen as lips; those behind are the wall of the mouth."""


_UPPER_ACROSS = np.sin(np.linspace(-np.pi / 2, np.pi / 2, _UPPER_COLUMNS))
ACROSS: Real = np.concatenate([_UPPER_ACROSS, _UPPER_ACROSS[-2:0:-1]])
"""Place of every column between the right corner (-1) and the left one (1)."""
SIDE: Real = np.concatenate([np.ones(_UPPER_COLUMNS), -np.ones(_UPPER_COLUMNS - 2)])
"""1 on the upper lip, -1 on the lower one."""


def _smooth(knots: list[tuple[float, float]]) -> Real:
    x, y = np.array(knots).T
    x, y = np.concatenate([-x[:0:-1], x]), np.concatenate([y[:0:-1], y])
    return np.asarray(CubicSpline(x, y)(ACROSS))


_BOW = _smooth([(0, 0.80), (0.2, 0.97), (0.36, 0.92), (0.62, 0.66), (0.85, 0.39), (1, 0)])
_LOWER_BOW = _smooth([(0, 1.0), (0.25, 0.97), (0.5, 0.83), (0.72, 0.59), (0.89, 0.35), (1, 0)])
_LINE = _smooth([(0, -0.006), (0.15, -0.005), (0.4, -0.002), (0.7, 0.005), (0.88, 0.010), (1, 0.014)])
_ENVELOPE = np.sqrt(np.maximum(1 - ACROSS**2, 0))
_FULL = np.where(SIDE > 0, _BOW, _LOWER_BOW)


def section_points(pose: CharacterPose, base_z: Real) -> Real:
    """Return the eight points of the cross-section of every column [shape=(8, COLUMNS, 3); stacked: (T, 8, ...)].

    pose   : one, or several of ``pose.stacked``
    base_z : depth of the skin under the outer contour at rest [shape=(COLUMNS,)]
    The fifth point is where the lips meet; the first is the contour, where the skin begins.
    """
    upper = SIDE > 0
    half = REST_HALF_WIDTH * pose.width
    x = half * ACROSS
    rise = pose.upper_rise
    drop = pose.gap - rise
    middle = _between(pose)
    # how much nearer to the middle than the corners the inner edge of the lips lies
    hole_share = (HOLE_WIDTH[0] + HOLE_WIDTH[1] * pose.gap) / (REST_HALF_WIDTH * pose.width)
    as_ring = np.maximum(1 - hole_share, 0.0) * (1 - 0.6 * pose.press) * (1 - LINE_SHARE * closed_share(pose, RING_GAP))
    squeeze = as_ring * pose.roundness + OVAL_SQUEEZE * pose.oval * (1 - pose.roundness)
    rounded = _ENVELOPE ** (1 + np.minimum(2 * pose.roundness, 1.0))
    belly = rounded + squeeze * (1 - rounded)
    hole, contour = _opening(pose)
    inner_y = middle + np.where(upper, rise, -drop) * hole
    full = _FULL + 0.85 * pose.roundness * (_ENVELOPE - _FULL)
    full = full + 0.4 * pose.spread * (_ENVELOPE - full)
    thick = np.where(upper, _UPPER_LIP, _LOWER_LIP) * full
    thick = thick * pose.fullness * (1 - 0.35 * pose.press) * np.where(upper, 1.0, 1 - 0.45 * pose.tuck)
    fuller = 1 + pose.roundness * 0.35 * ACROSS**2 * _ENVELOPE  # near the corners of a round mouth
    outer_y = middle + np.where(upper, rise, -drop) * contour + SIDE * thick * fuller
    forward = pose.protrusion * (1 - 0.45 * ACROSS**2)
    arch = -ARCH * (x**2 - (REST_HALF_WIDTH * ACROSS) ** 2)
    back = np.where(upper, 0.0, 0.22 * drop + 0.05 * pose.tuck) * _ENVELOPE
    outer_z = base_z + 0.85 * forward + arch - back
    lower_back = np.where(upper, 0.0, 0.25 * drop) * contour
    meet = _meeting(pose, base_z, 1 - squeeze) - lower_back
    bulge = (0.056 - 0.006 * SIDE * _ENVELOPE) * belly * pose.fullness * (1 - 0.3 * pose.press)
    inner_x = x * (1 - squeeze)
    teeth = TEETH_Z - ARCH * inner_x**2
    tuck = pose.tuck * np.where(upper, 0.0, 1.0) * _ENVELOPE
    contact_z = meet - 0.002 + 0.02 * belly * pose.roundness
    contact_z = contact_z + SEAM_FORWARD * (1 - 0.45 * pose.press) * belly * closed_share(pose)
    contact_z = contact_z + tuck * (teeth + 0.02 - contact_z)
    below_upper = np.minimum(BITTEN_EDGE_Y - middle, rise - LEAST_GAP)  # the teeth part the lips
    on_teeth = np.minimum(middle + below_upper * hole, inner_y + 0.08)
    inner_y = np.where(upper, inner_y, np.maximum(inner_y, inner_y + tuck * (on_teeth - inner_y)))
    crest = _meeting(pose, base_z, 1 - 0.5 * squeeze) - lower_back + bulge * (1 - 0.25 * tuck) - 0.03 * tuck
    behind = np.maximum(teeth + 0.022, contact_z - 0.10)
    y = outer_y
    broad = inner_y + pose.roundness * (middle + np.where(upper, rise, -drop) * contour - inner_y)
    crest_y = broad + 0.42 * (y - broad)
    deep = (0.13 - 0.05 * pose.roundness) * _ENVELOPE + 0.012
    rows = [
        (x, y, outer_z),
        (x * (1 - 0.2 * squeeze), inner_y + 0.76 * (y - inner_y), outer_z + 0.5 * (crest - outer_z)),
        (x * (1 - 0.5 * squeeze), crest_y, crest),
        (x * (1 - 0.85 * squeeze), inner_y + 0.31 * (crest_y - inner_y), contact_z + 0.66 * (crest - contact_z)),
        (inner_x, inner_y, contact_z),
        (x * (1 - 0.88 * squeeze), inner_y + SIDE * 0.014 * _ENVELOPE, 0.5 * (contact_z + behind)),
        (x * (1 - 0.45 * squeeze), inner_y + SIDE * (0.05 * _ENVELOPE + 0.002), behind),
        ((1.12 - 0.2 * pose.roundness) * x, inner_y + SIDE * deep, behind - 0.01),
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-3)


def _meeting(pose: CharacterPose, base_z: Real, inwards: Any) -> Real:
    """Return how far forward the lips meet, at places that much nearer to the middle [shape=(..., COLUMNS)]."""
    across = inwards * ACROSS
    lower_z = np.concatenate([base_z[:1], base_z[: _UPPER_COLUMNS - 1 : -1], base_z[_UPPER_COLUMNS - 1 :][:1]])
    between = np.interp(across, ACROSS[:_UPPER_COLUMNS], 0.5 * (base_z[:_UPPER_COLUMNS] + lower_z))
    curved = ARCH * REST_HALF_WIDTH**2 * (pose.width**2 - 1)
    return np.asarray(between + pose.protrusion - (0.45 * pose.protrusion + curved) * across**2)


def closed_share(pose: CharacterPose, apart: float = SEAM_GAP) -> Any:
    """Return how nearly the lips are closed: 1 where they touch, 0 from a gap of ``apart`` on [shape of the gap]."""
    return smooth_step(np.asarray(1 - pose.gap / apart))


def _between(pose: CharacterPose) -> Real:
    """Return the height of the line between the lips, closed, at every column [shape=(..., COLUMNS)]."""
    line = (1 - pose.roundness - 0.6 * pose.spread) * _LINE
    lowered = 0.22 * pose.gap * (1 - 0.6 * pose.spread) * (1 - 0.75 * pose.roundness)
    still = np.maximum(closed_share(pose, SMILE_GAP), pose.tuck)
    at_rest = REST_SMILE * still * (1 - pose.press) * (1 - pose.roundness)
    raised = (pose.smile + at_rest - lowered) * ACROSS**2
    bowed = ROUND_BOW * (1 - ACROSS**2) - ROUND_DROP - 0.2 * pose.gap
    return np.asarray(MOUTH_Y + line + raised + bowed * pose.roundness)


def _opening(pose: CharacterPose) -> tuple[Real, Real]:
    """Return the shapes of hole and outer contour, 1 in the middle, 0 at the corners [shape=(..., COLUMNS), both]."""
    reach = 1 - 0.10 * pose.oval - 0.30 * pose.tuck
    power = 2 + 1.2 * pose.spread
    inside = np.maximum(1 - np.abs(ACROSS / reach) ** power, 0)
    oval = (0.25 * np.clip(pose.gap / 0.2, 0, 1) + 0.2 * pose.oval) * (1 - pose.spread) * (1 - pose.roundness)
    hole = inside ** (0.92 - 0.40 * pose.roundness - 0.36 * pose.spread - oval)
    contour = np.maximum(1 - ACROSS**2, 0) ** (0.85 - 0.25 * pose.roundness - 0.33 * pose.spread - 0.7 * oval)
    return hole, contour


def lip_surface(points: Real) -> Real:
    """Return the places of lips and wall of the mouth [shape=(..., RINGS, COLUMNS, 3)] from ``section_points``."""
    front = np.einsum("rp,...pcx->...rcx", _SECTION, points)
    last = front[..., -1, :, :]
    middle = last.mean(axis=-2, keepdims=True)
    wall = []
    for inward, back in _WALL:
        ring = last + inward * (middle * [0, 1, 1] - last)
        ring[..., 2] += back
        wall.append(ring)
    return np.concatenate([front, np.stack(wall, axis=-3)], axis=-3)
