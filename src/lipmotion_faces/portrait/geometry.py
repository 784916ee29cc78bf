"""The pose of a drawn mouth in one frame, and its outlines as heights over columns.

Every outline is a function y(x), constructed outwards from the line where the lips meet, so that outlines
cannot cross: lips enclose the opening, teeth and tongue stay inside it. Unit: eye distances, y downwards.
A shift says, for places of the picture, how far away the place is whose pixel is shown there; in eye distances.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import smooth_step
from lipmotion.articulation.liveliness import CALM, UpperFace
from lipmotion.articulation.mouth import weigh_upper
from lipmotion_faces.portrait.design import LipDesign, open_curve
from lipmotion_faces.portrait.layer import Window

Heights = NDArray[np.float64]

TEETH_EDGE = 0.024  # the upper incisors end this far below the line of the closed lips; they belong to the skull
SPREAD_RISE = (0.5, 0.06)
"""The upper lip of spread lips rises by this part of the gap, at most so far: more of the upper teeth shows."""
LARGEST_RING_SHARE, LIP_RING_SHARE = 0.9, 0.8
"""Protruded lips are a ring round a hole: its thickness as a part of both lips, and its largest part of their width."""
ROUND_HOLE = (0.012, 0.85)  # half the width of the hole of protruded lips: a length, and a share of the gap
SMILE_RISE, FROWN_FALL, RAISED_LIP, CHIN_RISE = 0.11, 0.1, 0.055, 0.03
"""How far a mood raises the corners, lowers them, raises the upper lip, and the middle of both lips by the chin."""
TUCKED_LIP = 0.05  # least thickness of a lower lip under the upper teeth: thin lips are drawn thicker there, to be seen
_LINE = [(0, 0.006), (0.16, 0.005), (0.4, -0.005), (0.72, -0.004), (1, 0.004)]
_CUPIDS_BOW = [(0, 0.82), (0.08, 0.87), (0.22, 1.0), (0.36, 0.94), (0.62, 0.66), (0.85, 0.29), (1, 0)]
_LOWER = [(0, 1), (0.25, 0.975), (0.5, 0.855), (0.72, 0.61), (0.89, 0.29), (1, 0)]
_CURVES = {name: open_curve(knots).T for name, knots in (("line", _LINE), ("upper", _CUPIDS_BOW), ("lower", _LOWER))}


class MouthPose(NamedTuple):
    """The mouth in one frame, as ``articulation.mouth.SpokenMouth`` has it.

    gap      : distance of the inner lips, in eye distances; 0: they touch
    width    : distance of the lip corners relative to the rest pose
    fullness : thickness of the lips relative to the rest pose
    jaw      : drop of the chin, in eye distances
    tongue, tuck, protrusion, spread, press, teeth : the articulatory channels, 0..1 (docs/articulation.md)
    oval     : how far the opening is an oval: corners halfway down, round above and below, 0..1
    smile, frown, stretched, upper_raise, chin_raise, tight : of a mood, 0..1
    """

    gap: float
    width: float = 1.0
    fullness: float = 1.0
    jaw: float = 0.0
    tongue: float = 0.0
    tuck: float = 0.0
    protrusion: float = 0.0
    spread: float = 0.0
    press: float = 0.0
    teeth: float = 0.5
    oval: float = 0.0
    smile: float = 0.0
    frown: float = 0.0
    stretched: float = 0.0
    upper_raise: float = 0.0
    chin_raise: float = 0.0
    tight: float = 0.0


@dataclass(frozen=True, eq=False)
class LipOutlines:
    """Heights of the lips' outlines over columns [shape=(C, ...)], and half widths of seam and opening."""

    half_width: float
    inner_half_width: float
    corner_y: float
    upper_outer: Heights
    upper_inner: Heights
    lower_inner: Heights
    lower_outer: Heights
    seam: Heights


@dataclass(frozen=True, eq=False)
class MouthInterior:
    """Heights of the teeth and the tongue over columns [shape=(C, ...)], cut by the inner lips.

    Upper teeth reach down to ``teeth_upper``, lower teeth up to ``teeth_lower``. A tongue between the teeth reaches a
    little over the lower lip.
    """

    teeth_upper: Heights
    teeth_lower: Heights
    tongue_top: Heights
    tongue_bottom: Heights


def outline_lips(lips: LipDesign, pose: MouthPose, x: Heights) -> LipOutlines:
    """Return the outlines of the lips of a pose over the columns ``x`` [shape=(C, ...)]."""
    half_width = compute_half_width(lips, pose)
    u = np.minimum(np.abs(x) / half_width, 1)
    out, wide = pose.protrusion, pose.spread
    rise = float(weigh_upper(pose.gap))
    rise += wide * max(min(SPREAD_RISE[0] * pose.gap, SPREAD_RISE[1]) - rise, 0)
    rise += pose.tuck * (1 - out) * max(min(0.9 * pose.gap, 0.045) - rise, 0) + out * (0.47 * pose.gap - rise)
    rise += pose.upper_raise * max(min(0.8 * pose.gap, RAISED_LIP) - rise, 0)
    drop = pose.gap - rise
    middle = lips.line_y - CHIN_RISE * pose.chin_raise + pose.tuck * max(TEETH_EDGE - 0.018 - drop, -0.03) - 0.008 * out
    sag = (0.5 - 0.3 * wide) * drop * (1 - pose.tuck) - 0.012 * wide * (1 - pose.press)
    sag += out * (0.5 * (drop - rise) + 0.004 - sag)
    sag += pose.oval * (0.5 * (drop - rise) - sag) + 0.014 * pose.tuck
    bend = sag * u * u
    calm = (1 - 0.6 * min(pose.gap / 0.05, 1)) * (1 - 0.5 * pose.press)  # the smile fades as lips part or press
    smile = lips.smile * (1 - out) * (1 - pose.oval) * (1 - pose.tuck) * calm
    smile *= 1 - max(pose.frown, pose.stretched, pose.upper_raise, 0.8 * pose.tight)
    smile += (FROWN_FALL * pose.frown + 0.3 * FROWN_FALL * pose.stretched - SMILE_RISE * pose.smile) * (1 - 0.7 * out)
    line = middle + (1 - 0.7 * out) * np.interp(u, *_CURVES["line"]) + smile * u * u + bend
    # the lips are apart along a share of the width that grows with the gap; the hole of protruded lips is round, that
    # above a tucked lip is as wide as the teeth that show in it
    inner_share = min(0.72 + 0.2 * min(pose.gap / 0.12, 1) + 0.1 * wide * min(pose.gap / 0.05, 1), 0.95)
    inner_share += pose.tuck * (0.64 - inner_share)
    hole = _round_hole(pose) / half_width
    inner_share = float(inner_share + min(out / 0.85, 1) * (min(hole, inner_share) - inner_share))
    inner = u / inner_share
    open_share = min(pose.gap / 0.05, 1)
    free = wide * (1 - pose.tuck)
    upper_power = 0.7 - 0.22 * open_share * max(out, 1 - wide) - 0.26 * free
    lower_power = 0.6 - 0.12 * max(out, pose.oval) - 0.26 * free
    upper_inner = line - rise * _bend(inner, upper_power + pose.tuck * (0.85 - upper_power))
    lower_inner = line + drop * _bend(inner, lower_power + pose.tuck * (0.85 - lower_power))
    thin = 1 - 0.28 * pose.press * (1 - out)
    upper = lips.upper * pose.fullness * thin * (1 - 0.12 * pose.tuck + 0.2 * out - 0.14 * wide)
    lower = lips.lower * pose.fullness * thin * (1 - 0.5 * pose.tuck + 0.16 * out - 0.16 * wide * (1 - pose.tuck))
    lower = max(lower, TUCKED_LIP * pose.tuck)
    follow = 0.85 * (1 - 0.35 * out)
    # beside a round hole the line where the lips touch fades towards the corners
    beyond = np.clip((u - inner_share) / (0.08 * (1 - inner_share)), 0, 1)
    thick = 1 - min(out / 0.7, 1) * min(pose.gap / 0.03, 1) * (0.6 + 0.4 * beyond**0.5)
    return LipOutlines(
        half_width=half_width,
        inner_half_width=half_width * inner_share,
        corner_y=float(middle + (1 - 0.7 * out) * _LINE[-1][1] + smile + sag),
        upper_outer=np.minimum(line - rise * _bend(u, follow) - upper * _thicken("upper", u, out), upper_inner),
        upper_inner=upper_inner,
        lower_inner=lower_inner,
        lower_outer=np.maximum(
            line + drop * _bend(u, 0.62 - 0.15 * wide) + lower * _thicken("lower", u, out), lower_inner
        ),
        seam=lips.seam * (1 - u**4) * (1 + 0.2 * pose.press) * thick,
    )


def outline_interior(lips: LipDesign, pose: MouthPose, x: Heights, outlines: LipOutlines) -> MouthInterior:
    """Return teeth and tongue of a pose between the lips' outlines, over the columns ``x`` [shape=(C, ...)]."""
    edge = lips.line_y + TEETH_EDGE
    upper_edge = edge - 0.06 * pose.protrusion - 0.05 * max(0.5 - pose.teeth, 0) * (1 - measure_far_open(pose))
    upper = upper_edge - 0.35 * x * x
    reveal = min(max(2.8 * pose.teeth - 1.4, 0), 1) * (1 - pose.tuck)
    low_lip = float(outlines.lower_inner.max())
    below_lip = low_lip + 0.012 - 0.1 * pose.gap
    met = upper_edge + 0.004 + 0.05 * pose.jaw + 0.6 * max(pose.gap - 0.14, 0)
    met += max(0.86 - pose.teeth, 0) * (0.1 + 3 * max(pose.gap - 0.07, 0))
    lower = below_lip + reveal * (min(met, below_lip) - below_lip) + (0.2 - 0.55 * reveal) * x * x
    # the visible tongue: low, its tip behind the upper teeth, or between the teeth
    up, out = min(pose.tongue / 0.6, 1), max(pose.tongue - 0.6, 0) / 0.4
    rest = max(low_lip - (0.3 * pose.gap + 0.012) * (1 - pose.protrusion) + 0.02 * pose.protrusion, edge - 0.01)
    across = (x / (0.2 - 0.085 * up - 0.015 * out)) ** 2
    bulge = (1 - up) * 0.05 * (across + across**2) + up * 0.05 * across**2 * (0.5 + 0.5 * across)
    top = rest + up * (min(edge - 0.01, rest) - rest) + 0.004 * out + bulge
    bottom = low_lip + 0.03 - 0.03 * across
    over = out * 0.009 * _bend(x / min(0.09, 0.9 * outlines.inner_half_width), 0.5)
    cut = outlines.upper_inner, outlines.lower_inner
    return MouthInterior(
        np.clip(upper, cut[0], cut[1]),
        np.clip(np.maximum(lower, upper), *cut),
        np.clip(top, *cut),
        np.clip(np.maximum(top, bottom), cut[0], cut[1] + over),
    )


def compute_half_width(lips: LipDesign, pose: MouthPose) -> float:
    """Return half the width of the drawn lips: protruded lips draw their corners in, closed ones less."""
    flat = lips.half_width * pose.width
    ring = min(LARGEST_RING_SHARE * flat, _round_hole(pose) + LIP_RING_SHARE * (lips.upper + lips.lower))
    return flat + pose.protrusion * (0.3 + 0.7 * min(pose.gap / 0.03, 1)) * (ring - flat)


def _round_hole(pose: MouthPose) -> float:
    return ROUND_HOLE[0] + ROUND_HOLE[1] * pose.gap


def measure_far_open(pose: MouthPose) -> float:
    """Return how far a mouth is open so wide that its upper teeth are seen whatever the sound, 0..1."""
    return min(max((pose.gap - 0.06 - 0.05 * pose.protrusion) / 0.05, 0), 1)


def _thicken(lip: str, u: Heights, out: float) -> Heights:
    """Return the thickness of a lip along its half width; rounded lips stay thick towards their corners."""
    round_ = min(1.15 * out, 1)
    return (1 - round_) * np.interp(u, *_CURVES[lip]) + round_ * _bend(u, 0.5)


def _bend(u: Heights, power: float) -> Heights:
    """Return an arch over -1 <= u <= 1: 1 in the middle, 0 at the ends and beyond."""
    return np.maximum(1 - u * u, 0) ** power


Floats = NDArray[np.float64]

STEP = 8  # shifts are computed at every eighth pixel and interpolated between
JAW_TOP, CHIN = -0.24, 0.4
"""Between these heights, from the line of the lips, skin is stretched when the jaw drops; below, it moves with it."""
PIVOT_Y = 1.35  # the head rolls about this point of the neck
BROW_STEPS = 8  # positions of raised brows in a pixel
MOOD_STEPS = 24  # positions of the brows on the way to a mood
INNER_RISE, OUTER_RISE, LOWERED, TOGETHER = 0.13, 0.1, (0.115, 0.05), 0.06
"""How far a mood raises inner and outer ends of brows, lowers inner and outer ones, and draws them together."""
NOSE_LIFT, CHEEK_LIFT = 0.05, 0.06  # how far wrinkling lifts the wings of the nose, and a smile the cheeks
NECK_TOP, NECK_END = 1.15, 1.85  # between these heights the movement of the head fades


class HeadPlacement(NamedTuple):
    """Where the head is: shifts in eye distances, to the right and down; angles in radians."""

    x: float = 0.0
    y: float = 0.0
    roll: float = 0.0  # to the speaker's left shoulder, clockwise in the picture
    yaw: float = 0.0  # features move to the right against the outline of the head
    pitch: float = 0.0  # features move down against it: nodding


class SkinField:
    """Shifts of the skin below the eyes by a pose of the mouth, over a window."""

    def __init__(self, window: Window, lips: LipDesign) -> None:
        x, y = list_grid(window)
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

    def shift(self, pose: MouthPose, mood: UpperFace = CALM) -> tuple[Floats, Floats]:
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


class BrowField:
    """Shifts of the skin of the forehead by raised or lowered brows, over a window."""

    def __init__(self, window: Window) -> None:
        x, y = list_grid(window)
        self._scale = window.view.scale
        fade = np.clip((-0.1 - y) / 0.07, 0, 1) * np.clip((y + 0.62) / 0.2, 0, 1)
        bump = fade * np.exp(-(((np.abs(x) - 0.36) / 0.34) ** 4))
        self._both = bump
        outwards = np.clip((np.abs(x) - 0.13) / 0.45, 0, 1)
        self._inner, self._outer = (1 - outwards) ** 1.5, np.sin(np.pi * outwards**1.3 * 0.72)
        self._inwards = np.sign(x) * (1 - outwards) * fade * np.clip(np.abs(x) / 0.1, 0, 1)

    def shift(self, brows: BrowPose) -> tuple[Floats, Floats]:
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
        x, y = list_grid(window)
        self._scale, self._x, self._y = window.view.scale, x, y
        self._with_head = smooth_step((NECK_END - y) / (NECK_END - NECK_TOP))
        self._features = np.exp(-((x / 0.62) ** 2) - (((y - 0.35) / 0.85) ** 2)) * self._with_head

    def shift(self, pose: HeadPlacement) -> tuple[Floats, Floats]:
        """Return the shifts to the right and down, in pixels."""
        x = self._with_head * (pose.x - pose.roll * (self._y - PIVOT_Y)) + pose.yaw * self._features
        y = self._with_head * (pose.y + pose.roll * self._x) + pose.pitch * self._features
        return -x * self._scale, -y * self._scale


def list_grid(window: Window) -> tuple[Floats, Floats]:
    """Return x and y of every ``STEP``-th pixel of a window, in eye distances [shapes=(h, w)]."""
    columns = np.arange(0, window.x1 - window.x0 + STEP, STEP) + window.x0 + 0.5
    rows = np.arange(0, window.y1 - window.y0 + STEP, STEP) + window.y0 + 0.5
    x, y = (columns - window.view.origin[0]) / window.view.scale, (rows - window.view.origin[1]) / window.view.scale
    return np.broadcast_to(x, (len(y), len(x))), np.broadcast_to(y[:, None], (len(y), len(x)))
