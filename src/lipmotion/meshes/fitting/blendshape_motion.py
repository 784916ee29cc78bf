"""A mouth of ARKit's blendshapes alone, and motion of blendshapes as motion of a mouth.

The places of the mouth are those of the template, its shapes are formulas on them: what ARKit's documentation shows of
each, in eye distances. docs/results/rig.md compares them with a scanned head's. Models that were trained on
blendshapes, captures and edited curves have channels such as ``jawOpen`` and no ``opening``: weights that move this
mouth give them the distances and points that faces draw.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import GAP, MIN_GAP, gap_to_opening
from lipmotion.articulation.lip_points import (
    CHIN,
    FACING,
    LEFT_CORNER,
    LOWER_EDGE,
    RIGHT_CORNER,
    UPPER_EDGE,
    build_mouth,
)
from lipmotion.articulation.mouth import MIN_CHIN_DROP_SHARE, SpokenMouth, find_mouth, measure_jaw_drop, weigh_upper
from lipmotion.articulation.rest import find_rest_frames
from lipmotion.errors import InputError
from lipmotion.meshes.model.face_shapes import FaceShapes
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, OPENS, VOWELS, VRM_VOWELS, convert_to_arkit, to_arkit
from lipmotion.storage.sources import read_shipped_table
from lipmotion.types import EYE_DISTANCE, WEIGHT, Channel, Motion, Timeline, Unit

Array = NDArray[np.float64]
Real = NDArray[np.floating[Any]] | float
HINGE = (-0.45, -0.75)  # the axis of the jaw: height and depth behind the eyes, in eye distances
JAW_ANGLE_RAD = 0.44  # how far ``jawOpen`` turns the jaw: the lower lip goes down by about half an eye distance
UPPER_PART = 0.08  # the share of the gap that the upper lip closes in ``mouthClose``; the lower lip closes the rest
MIN_OPENING = 0.05  # a blendshape that parts the lips by more, in eye distances, opens the mouth
ARTICULATORY: dict[str, dict[str, float]] = defaultdict(dict)
for _row in read_shipped_table("lipmotion.meshes.fitting", "articulatory.csv"):
    ARTICULATORY[_row["channel"]][_row["blendshape"]] = float(_row["gain"])
"""What blendshapes say of the articulatory channels (docs/articulation.md): their weights, times these, added up."""


@cache
def arkit_mouth() -> FaceShapes:
    """Return ARKit's blendshapes of the mouth as displacements of the lip and jaw points."""
    moved = np.array([_displace_points(name) for name in ARKIT_MOUTH])
    template = build_mouth()
    facing = [(template.row(upper), template.row(lower)) for upper, lower in FACING[:3]]
    gap = np.mean([moved[:, upper, 1] - moved[:, lower, 1] for upper, lower in facing], axis=0)
    return FaceShapes(ARKIT_MOUTH, ARKIT_MOUTH, moved, gap, "arkit")


@cache
def vowel_mouth() -> FaceShapes:
    """Return the vowels of VRM, made of ARKit's blendshapes (``VOWELS``), as displacements of points."""
    mouth = arkit_mouth()
    sources = [dict(VOWELS.get(known, ())) for known in mouth.known]
    gains = np.array([[each.get(vowel, 0.0) for each in sources] for vowel in VRM_VOWELS])
    moved = np.einsum("vs,spd->vpd", gains, mouth.moved)
    return FaceShapes(VRM_VOWELS, tuple(f"vowel_{name}" for name in VRM_VOWELS), moved, gains @ mouth.gap, "visemes")


class _Regions:
    """Where the points are: 1 in the middle of a region, 0 outside it [each shape=(52,)]."""

    def __init__(self) -> None:
        template = build_mouth()
        self.places = template.places
        self.across = np.clip(self.places[:, 0] / (template.width / 2), -1.0, 1.0)
        middle = np.sqrt(1 - self.across**2)
        self.lips = (~template.jaw).astype(float)
        self.upper, self.lower = template.upper * middle, template.lower * middle
        self.edge = (~template.inner).astype(float) * self.lips
        self.corner = np.abs(self.across) ** 3 * self.lips
        self.jaw = template.jaw.astype(float)
        self.chin = self.jaw * np.exp(-((self.places[:, 0] / 0.3) ** 2))
        self.left, self.right = (np.clip(0.5 + 1.5 * side * self.across, 0, 1) for side in (1, -1))


def _displace_points(name: str) -> Array:
    """Return how one blendshape moves the points at weight 1 [shape=(52, 3)]."""
    regions = _Regions()
    if name == "jawOpen":
        return _open_jaw(regions)
    if name == "mouthClose":
        return _close_before_jaw(regions)
    if name in {"jawLeft", "jawRight", "mouthLeft", "mouthRight"}:
        way = 0.15 if name.endswith("Left") else -0.15
        moving = regions.jaw + 0.6 * regions.lower if name.startswith("jaw") else regions.lips
        return np.outer(moving, [way, 0, 0])
    base = name.removesuffix("Left").removesuffix("Right")
    displaced = _FORMS[base](regions) if base in _FORMS else np.zeros_like(regions.places)
    side = regions.left if name.endswith("Left") else regions.right
    return displaced if name == base else displaced * side[:, None]


def _open_jaw(regions: _Regions) -> Array:
    """Return the jaw turned about its hinge; the lower lip follows wholly, corners by 0.45, the upper lip hardly."""
    share = regions.jaw + regions.lips * (0.45 + 0.55 * regions.lower - 0.45 * regions.upper)
    arm = regions.places[:, 1:] - HINGE
    cosine, sine = np.cos(JAW_ANGLE_RAD), np.sin(JAW_ANGLE_RAD)
    displacements = np.zeros_like(regions.places)
    displacements[:, 1:] = share[:, None] * (arm @ np.array([[cosine, sine], [-sine, cosine]]) - arm)
    displacements[:, 0] = -0.06 * regions.across * (regions.lips - regions.upper) * (1 - regions.jaw)
    return displacements


def _close_before_jaw(regions: _Regions) -> Array:
    """Return the lips closed in front of the open jaw: the exact opposite of the gap that ``jawOpen`` makes."""
    jaw, template = _open_jaw(regions), build_mouth()
    where, gaps = [-1.0, 1.0], [0.0, 0.0]  # the gap from the right corner to the left
    below = np.flatnonzero(template.lower & template.inner)
    for row in np.flatnonzero(template.upper & template.inner):
        other = below[np.abs(template.places[below, 0] - template.places[row, 0]).argmin()]
        where.append(float(regions.across[row]))
        gaps.append(float(jaw[row, 1] - jaw[other, 1]))
    order = np.argsort(where, kind="stable")
    gap = np.interp(regions.across, np.array(where)[order], np.array(gaps)[order])
    lower, upper = template.lower.astype(float), template.upper.astype(float)
    displacements = np.zeros_like(jaw)
    displacements[:, 1] = gap * np.where(template.inner, 1.0, 0.9) * ((1 - UPPER_PART) * lower - UPPER_PART * upper)
    displacements[:, 2] = -0.9 * jaw[:, 2] * lower
    return displacements


def _form(x: Real, y: Real, z: Real, regions: _Regions) -> Array:
    return np.stack([value * regions.lips for value in (x, y, z)], axis=1)


_FORMS: dict[str, Callable[[_Regions], Array]] = {
    "jawForward": lambda r: np.outer(r.jaw + 0.7 * r.lower, [0, 0, 0.16]),
    "mouthFunnel": lambda r: _form(-0.15 * r.across, 0.08 * r.upper - 0.12 * r.lower, 0.09 * (1 - r.corner), r),
    "mouthPucker": lambda r: _form(-0.15 * r.across, -0.01 * r.upper + 0.01 * r.lower, 0.10 * (1 - 0.6 * r.corner), r),
    "mouthSmile": lambda r: _form(0.14 * r.across, 0.14 * r.corner, -0.08 * r.corner, r),
    "mouthFrown": lambda r: _form(0.02 * r.across, -0.07 * r.corner, -0.01 * r.corner, r),
    "mouthDimple": lambda r: _form(0.06 * r.across, 0.01 * r.corner, -0.07 * r.corner, r),
    "mouthStretch": lambda r: _form(0.10 * r.across, -0.03 * r.corner, -0.04 * r.corner, r),
    "mouthRollLower": lambda r: _form(0, 0.07 * r.lower * r.edge, -0.11 * r.lower, r),
    "mouthRollUpper": lambda r: _form(0, -0.07 * r.upper * r.edge, -0.11 * r.upper, r),
    "mouthShrugLower": lambda r: _form(0, 0.09 * r.lower, 0.04 * r.lower, r) + np.outer(r.chin, [0, 0.12, 0.02]),
    "mouthShrugUpper": lambda r: _form(0, 0.075 * r.upper, 0.045 * r.upper, r),
    "mouthPress": lambda r: _form(0, 0.012 * r.lower - 0.012 * r.upper, -0.015 * (1 - r.corner), r),
    "mouthLowerDown": lambda r: _form(0, -0.11 * r.lower, -0.01 * r.lower, r),
    "mouthUpperUp": lambda r: _form(0, 0.12 * r.upper, 0.0, r),
}
"""The shapes that one formula gives; those of a side are weighted by how far a point is on it."""


def is_of_blendshapes(motion: Motion) -> bool:
    """Return whether motion has blendshapes that open the mouth, and no channel ``opening``."""
    return "opening" not in motion.names and OPENS in arkit_weights(motion)


def with_mouth(motion: Motion) -> Motion:
    """Return motion of blendshapes with the channels that faces draw after its own; other motion as it is.

    Added are ``lip_gap``, the ``opening`` that trackers would measure, ``width``, ``outer``, the lip and jaw points,
    and the articulatory channels that blendshapes show. Weights that are not between 0 and 1 count as 0 or 1.
    """
    if not is_of_blendshapes(motion):
        return motion
    weights, mouth, template = arkit_weights(motion), arkit_mouth(), build_mouth()
    rows = np.stack([weights.get(name, np.zeros(len(motion.values))) for name in mouth.known], axis=1)
    jaw, close = mouth.known.index(OPENS), mouth.known.index("mouthClose")
    rows[:, close] = np.minimum(rows[:, close], rows[:, jaw])
    places = template.places + (rows @ mouth.moved.reshape(len(mouth.known), -1)).reshape(-1, *template.places.shape)
    gap = np.maximum(rows @ mouth.gap, 0.0)
    gap[gap < MIN_GAP / 2] = 0.0
    added = {"opening": (gap_to_opening(gap), EYE_DISTANCE), GAP: (gap, EYE_DISTANCE)}
    for name, one, other in (("width", LEFT_CORNER, RIGHT_CORNER), ("outer", UPPER_EDGE, LOWER_EDGE)):
        across = places[:, template.row(one), :2] - places[:, template.row(other), :2]
        added[name] = np.linalg.norm(across, axis=1), EYE_DISTANCE
    for row, point in enumerate(template.points):
        added |= {f"{axis}_{point}": (places[:, row, column], EYE_DISTANCE) for column, axis in enumerate("xyz")}
    for name, gains in ARTICULATORY.items():
        if gains.keys() & weights.keys():
            total = sum(gain * weights[source] for source, gain in gains.items() if source in weights)
            added[name] = np.clip(total, 0, 1), WEIGHT
    added = {name: each for name, each in added.items() if name not in motion.names}
    values = np.concatenate([motion.values, np.stack([curve for curve, _ in added.values()], axis=1)], axis=1)
    channels = (*motion.channels, *(Channel(name, unit) for name, (_, unit) in added.items()))
    return Motion(values, motion.rate_hz, channels)


def arkit_weights(motion: Motion) -> dict[str, Array]:
    """Return the curves of a motion that are blendshapes, by ARKit's names, 0 to 1 [each shape=(T,)].

    Names are known in the spellings of files; of two spellings of one, the first. Blendshapes of other sets are
    converted (``convert_to_arkit``) where no ``jawOpen`` moves: some programs write it beside them as 0.
    """
    weights: dict[str, Array] = {}
    for name in motion.names:
        known = to_arkit(name)
        if known is not None:
            weights.setdefault(known, np.clip(motion[name].astype(np.float64), 0, 1))
    if OPENS not in weights or not weights[OPENS].any():
        weights |= {name: np.clip(curve, 0, 1) for name, curve in convert_to_arkit(motion).items()}
    return weights


def find_own_weights(motion: Motion, shapes: FaceShapes) -> Motion | None:
    """Return the weights that a motion has for the blendshapes of a mesh, by the mesh's names; None: it has none.

    A blendshape is found by its own name, or else by ARKit's; at least one of those that are found must open the mouth.
    Blendshapes that the motion does not have stay 0.
    """
    weights = arkit_weights(motion)
    by_name = {name: np.clip(motion[name].astype(np.float64), 0, 1) for name in shapes.names if name in motion.names}
    by_name = {name: curve for name, curve in by_name.items() if curve.any() or to_arkit(name) != OPENS}
    curves = [by_name.get(name, weights.get(known)) for name, known in zip(shapes.names, shapes.known, strict=True)]
    if not any(curve is not None and gap > MIN_OPENING for curve, gap in zip(curves, shapes.gap, strict=True)):
        return None
    nothing = np.zeros(len(motion.values))
    values = np.stack([nothing if curve is None else curve for curve in curves], axis=1)
    return Motion(values, motion.rate_hz, tuple(Channel(name, WEIGHT) for name in shapes.names))


MIN_PROTRUSION = 0.03  # protruded lips are at least so far in front of their rest pose, in eye distances
CORNER_RISE, CORNER_FALL = 0.1, 0.07
"""How far points of the corners rise in a full smile, and fall where a mood pulls them down, in eye distances."""
KNOWN_GAP = 0.02
"""From this distance of the measured points on, the opening has the shape that they show, in eye distances."""


@dataclass(frozen=True, eq=False)
class PointMotion:
    """Lip and jaw points over time, away from the rest pose.

    displacements : of the 52 points of the template, in its order, eye distances, head frame [shape=(T, 52, 3)]; the
                    middles of the inner lips are apart by the gap of the mouth
    mouth         : the mouth that they show, one frame a frame
    """

    displacements: Array
    mouth: SpokenMouth

    @property
    def expressed(self) -> Array:
        """The displacements with those of a mood: corners that rise, or fall, and less beside them."""
        template, mouth = build_mouth(), self.mouth
        across = np.clip(np.abs(template.places[:, 0]) / (template.width / 2), 0, 1)
        moved = self.displacements.copy()
        moved[..., 1] += np.outer(CORNER_RISE * mouth.smile - CORNER_FALL * mouth.frown, across**3 * ~template.jaw)
        return moved


def move_points(motion: Motion, units: Timeline[Unit]) -> PointMotion:
    """Return the motion of lip and jaw points away from the rest pose, which is that of the silences.

    Motion that has points is taken as it is; of motion with distances alone (``opening``, perhaps ``width``, ``outer``)
    the points are made up, as mouths usually move. Motion of blendshapes alone moves ``blendshape_motion.arkit_mouth``.
    Gap, width and protrusion are those of the mouth (``articulation.mouth.find_mouth``).
    units : phones in time
    Raises InputError: as ``find_mouth``, or values that are not finite.
    """
    motion = with_mouth(motion)
    mouth = find_mouth(motion, units)
    if not np.isfinite(motion.values).all():
        raise InputError("the motion has values that are not finite; interpolate the missing frames first")
    rest, template = find_rest_frames(motion, units), build_mouth()
    names = [[f"{axis}_{point}" for axis in "xyz"] for point in template.points]
    if all(name in motion.names for row in names for name in row):
        places = np.stack([np.stack([motion[name] for name in row], axis=1) for row in names], axis=1)
        shifts = places.astype(np.float64) - np.median(places[rest], axis=0)
    else:
        shifts = _invent_points(motion, rest, mouth)
    # now with gap, width and protrusion of the mouth: the lips of a person at rest are not wholly closed
    across = np.clip(template.places[:, 0] / (template.width / 2), -1, 1)
    lips, right, left = ~template.jaw, template.row(RIGHT_CORNER), template.row(LEFT_CORNER)
    wider = (mouth.width - 1) * template.width - (shifts[:, left, 0] - shifts[:, right, 0])
    shifts[:, lips, 0] += np.outer(wider / 2, across[lips])
    forward = np.maximum(MIN_PROTRUSION * mouth.protrusion - shifts[:, lips, 2].mean(axis=1), 0) * mouth.protrusion
    shifts[:, lips, 2] += forward[:, None]
    shifts[:, :, 1] += _separate_lips(shifts[:, :, 1], across, mouth.gap)
    higher = shifts[:, template.row(CHIN), 1] + MIN_CHIN_DROP_SHARE * measure_jaw_drop(mouth.gap) * (1 - mouth.tuck)
    shifts[:, template.jaw, 1] -= np.maximum(higher, 0)[:, None]
    return PointMotion(shifts, mouth)


def _separate_lips(heights: Array, across: Array, gap: Array) -> Array:
    """Return how the points of both lips move up or down for a gap between their middles [shape=(T, 52)]."""
    template = build_mouth()
    pairs = np.array([(template.row(upper), template.row(lower)) for upper, lower in FACING])
    pairs = pairs[np.argsort(across[pairs[:, 0]], kind="stable")]
    places, half = across[pairs[:, 0]], len(pairs) // 2
    apart = heights[:, pairs[:, 0]] - heights[:, pairs[:, 1]]
    middle = apart[:, [half]]
    known = np.clip(middle / KNOWN_GAP, 0, 1)
    shape = known * apart / np.maximum(middle, KNOWN_GAP / 10) + (1 - known) * np.sqrt(1 - places**2)
    lacking = np.clip(shape, 0, 1.2) * gap[:, None] - apart
    lacking[:, half] = gap - middle[:, 0]
    lacking, places = np.pad(lacking, ((0, 0), (1, 1))), np.concatenate([[-1.0], places, [1.0]])
    lips = np.flatnonzero(template.upper | template.lower)
    right = np.clip(np.searchsorted(places, across[lips]), 1, len(places) - 1)
    share = (across[lips] - places[right - 1]) / (places[right] - places[right - 1])
    parted = (lacking[:, right - 1] * (1 - share) + lacking[:, right] * share) / 2
    displacements = np.zeros_like(heights)
    displacements[:, lips] = np.where(template.upper[lips], parted, -parted)
    displacements[:, pairs[:, 0]], displacements[:, pairs[:, 1]] = lacking[:, 1:-1] / 2, -lacking[:, 1:-1] / 2
    return displacements


def _invent_points(motion: Motion, rest: NDArray[np.bool_], mouth: SpokenMouth) -> Array:
    """Return displacements of the points from distances alone [shape=(T, 52, 3)]."""
    template = build_mouth()
    middle = np.sqrt(1 - np.clip(template.places[:, 0] / (template.width / 2), -1, 1) ** 2)
    rise = weigh_upper(mouth.gap)
    drop = mouth.gap - rise
    moved = np.zeros((len(mouth.gap), len(template.points), 3))
    moved[:, template.upper, 1] = np.outer(rise, middle[template.upper])
    moved[:, template.lower, 1] = -np.outer(drop, middle[template.lower])
    moved[:, template.jaw, 1] = -mouth.jaw[:, None]
    moved[:, template.corner, 1] = -0.3 * drop[:, None]
    if "outer" in motion.names:
        thicker = (motion["outer"] - motion["opening"]) / 2
        thicker = thicker - np.median(thicker[rest])
        edges = ~template.inner & ~template.corner & ~template.jaw
        moved[:, edges, 1] += np.outer(thicker, np.where(template.upper, middle, -middle)[edges])
    if f"y_{CHIN}" in motion.names:
        chin = motion[f"y_{CHIN}"]
        moved[:, template.jaw, 1] = (chin - np.median(chin[rest]))[:, None]
    return moved
