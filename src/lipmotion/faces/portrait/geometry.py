"""Outlines of the mouth for one pose, as heights over columns.

Every outline is a function y(x), constructed outwards from the line where the lips meet, so that outlines
cannot cross: lips enclose the opening, teeth and tongue stay inside it. Unit: eye distances, y downwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lipmotion.faces.portrait.outlines import open_curve
from lipmotion.faces.portrait.pose import MouthPose, upper_share
from lipmotion.faces.portrait.view import Pixels

LINE_Y = 0.9
HALF_WIDTH = 0.3
UPPER_LIP, LOWER_LIP = 0.085, 0.135
TEETH_EDGE = 0.028
"""The upper incisors end this far below the line of the closed lips; they belong to the skull."""
LOWER_TEETH_EDGE = 0.01
"""The lower incisors begin here when the jaw is closed, behind the upper ones; they move with the jaw."""

_LINE = [(0, 0.007), (0.14, 0.004), (0.38, -0.004), (0.7, -0.015), (1, -0.036)]
_CUPIDS_BOW = [(0, 0.82), (0.08, 0.87), (0.22, 1.0), (0.36, 0.94), (0.62, 0.66), (0.85, 0.29), (1, 0)]
_LOWER = [(0, 1), (0.25, 0.975), (0.5, 0.855), (0.72, 0.61), (0.89, 0.29), (1, 0)]
_CURVES = {name: open_curve(knots).T for name, knots in (("line", _LINE), ("upper", _CUPIDS_BOW), ("lower", _LOWER))}


@dataclass(frozen=True, eq=False)
class LipOutlines:
    """Heights of the lips' outlines over columns [shape=(C, ...)], top to bottom; all meet at the corners and beyond.

    seam : half the thickness of the line where the lips meet
    """

    half_width: float
    corner_y: float
    upper_outer: Pixels
    upper_inner: Pixels
    lower_inner: Pixels
    lower_outer: Pixels
    seam: Pixels


@dataclass(frozen=True, eq=False)
class MouthInterior:
    """Heights of the teeth and the tongue over columns [shape=(C, ...)], cut by the inner lips.

    Upper teeth reach down to ``teeth_upper``, lower teeth up to ``teeth_lower``.
    """

    teeth_upper: Pixels
    teeth_lower: Pixels
    tongue_top: Pixels
    tongue_bottom: Pixels


def lip_outlines(pose: MouthPose, x: Pixels) -> LipOutlines:
    """Return the outlines of the lips of a pose over the columns ``x`` [shape=(C, ...)]."""
    half_width = HALF_WIDTH * pose.width
    u = np.minimum(np.abs(x) / half_width, 1)
    round_ = roundness(pose)
    rise = float(upper_share(pose.gap))
    drop = pose.gap - rise
    to_teeth = TEETH_EDGE - 0.004 - drop - _LINE[0][1]
    middle = LINE_Y + pose.tuck * max(to_teeth, -0.04)
    sag = 0.4 * pose.jaw + 0.04 * round_
    line = middle + _on("line", u) + sag * u * u
    inner = u / _inner_width(pose.gap, round_)
    upper_inner = line - rise * _arch(inner, 0.75 - 0.2 * round_)
    lower_inner = line + drop * _arch(inner, 0.54 - 0.06 * round_)
    upper_lip = UPPER_LIP * pose.fullness * (1 - 0.15 * pose.tuck + 0.25 * round_) * _thickness("upper", u, round_)
    lower_lip = LOWER_LIP * pose.fullness * (1 - 0.35 * pose.tuck - 0.15 * round_) * _thickness("lower", u, round_)
    return LipOutlines(
        half_width=half_width,
        corner_y=middle + _LINE[-1][1] + sag,
        upper_outer=np.minimum(line - rise * _arch(u, 0.85) - upper_lip, upper_inner),
        upper_inner=upper_inner,
        lower_inner=lower_inner,
        lower_outer=np.maximum(line + drop * _arch(u, 0.6) + lower_lip, lower_inner),
        seam=0.0065 * (1 - u**4),
    )


def mouth_interior(pose: MouthPose, x: Pixels, outlines: LipOutlines) -> MouthInterior:
    """Return teeth and tongue of a pose between the lips, over the columns ``x`` [shape=(C, ...)].

    outlines : of the lips of this pose
    """
    upper = LINE_Y + TEETH_EDGE - 0.03 * roundness(pose) - 0.5 * x * x
    lower = LINE_Y + LOWER_TEETH_EDGE + pose.jaw + 0.25 * x * x
    top, bottom = _tongue(pose, x)
    heights = (upper, lower, top, np.maximum(top, bottom))
    return MouthInterior(*(np.clip(height, outlines.upper_inner, outlines.lower_inner) for height in heights))


def roundness(pose: MouthPose) -> float:
    """Return how rounded the lips are, 0..1: 1 at 70 % of their rest width."""
    return min(max((0.97 - pose.width) / 0.27, 0), 1)


def _on(curve: str, u: Pixels) -> Pixels:
    return np.interp(u, *_CURVES[curve]).astype(np.float32)


def _thickness(lip: str, u: Pixels, round_: float) -> Pixels:
    """Return the thickness of a lip along its half width; rounded lips stay thick towards their corners."""
    return (1 - 0.6 * round_) * _on(lip, u) + 0.6 * round_ * _arch(u, 0.5)


def _arch(u: Pixels, power: float) -> Pixels:
    """Return an arch over -1 <= u <= 1: 1 in the middle, 0 at the ends and beyond."""
    return np.maximum(1 - u * u, 0) ** power


def _inner_width(gap: float, round_: float) -> float:
    """Return the share of the mouth's width along which the lips are apart; it grows with the gap."""
    return (0.74 + 0.18 * min(gap / 0.12, 1)) * (1 - 0.32 * round_)


def _tongue(pose: MouthPose, x: Pixels) -> tuple[Pixels, Pixels]:
    """Return top and bottom of the visible tongue: its back behind the lower teeth, or its tip between the teeth."""
    teeth = LINE_Y + LOWER_TEETH_EDGE + pose.jaw
    upper_teeth = LINE_Y + TEETH_EDGE
    back = max(teeth - min(0.08, 0.32 * pose.gap), upper_teeth)
    tip = upper_teeth - 0.014
    top = back + pose.tip * (tip - back)
    half_width = 0.2 - 0.04 * pose.tip
    bulge = 0.06 - 0.01 * pose.tip
    bottom = teeth + 0.25 * x * x + pose.tip * 0.02
    return top + bulge * (x / half_width) ** 2, bottom
