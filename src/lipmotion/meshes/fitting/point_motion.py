"""Motion as a character needs it: the spoken mouth, and how lip and jaw points leave the rest pose with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.lip_points import CHIN, FACING, LEFT_CORNER, RIGHT_CORNER, mouth_template
from lipmotion.articulation.mouth import LEAST_CHIN_DROP_SHARE, SpokenMouth, jaw_drop, spoken_mouth, upper_share
from lipmotion.articulation.rest import find_rest_frames
from lipmotion.errors import InputError
from lipmotion.meshes.fitting.blendshape_motion import with_mouth
from lipmotion.types import Motion, Timeline, Unit

Array = NDArray[np.float64]

MIN_PROTRUSION = 0.03
"""Protruded lips are at least so far in front of their rest pose, in eye distances."""
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
        template, mouth = mouth_template(), self.mouth
        across = np.clip(np.abs(template.places[:, 0]) / (template.width / 2), 0, 1)
        moved = self.displacements.copy()
        moved[..., 1] += np.outer(CORNER_RISE * mouth.smile - CORNER_FALL * mouth.frown, across**3 * ~template.jaw)
        return moved


def move_points(motion: Motion, units: Timeline[Unit]) -> PointMotion:
    """Return the motion of lip and jaw points away from the rest pose, which is that of the silences.

    Motion that has points is taken as it is; of motion with distances alone (``opening``, perhaps ``width``, ``outer``)
    the points are made up, as mouths usually move. Motion of blendshapes alone moves ``blendshape_motion.arkit_mouth``.
    Gap, width and protrusion are those of the mouth (``articulation.mouth.spoken_mouth``).
    units : phones in time
    Raises InputError: as ``spoken_mouth``, or values that are not finite.
    """
    motion = with_mouth(motion)
    mouth = spoken_mouth(motion, units)
    if not np.isfinite(motion.values).all():
        raise InputError("the motion has values that are not finite; interpolate the missing frames first")
    rest, template = find_rest_frames(motion, units), mouth_template()
    names = [[f"{axis}_{point}" for axis in "xyz"] for point in template.points]
    if all(name in motion.names for row in names for name in row):
        places = np.stack([np.stack([motion[name] for name in row], axis=1) for row in names], axis=1)
        moved = places.astype(np.float64) - np.median(places[rest], axis=0)
    else:
        moved = _invent_points(motion, rest, mouth)
    # now with gap, width and protrusion of the mouth: the lips of a person at rest are not wholly closed
    across = np.clip(template.places[:, 0] / (template.width / 2), -1, 1)
    lips, right, left = ~template.jaw, template.row(RIGHT_CORNER), template.row(LEFT_CORNER)
    wider = (mouth.width - 1) * template.width - (moved[:, left, 0] - moved[:, right, 0])
    moved[:, lips, 0] += np.outer(wider / 2, across[lips])
    forward = np.maximum(MIN_PROTRUSION * mouth.protrusion - moved[:, lips, 2].mean(axis=1), 0) * mouth.protrusion
    moved[:, lips, 2] += forward[:, None]
    moved[:, :, 1] += _part_lips(moved[:, :, 1], across, mouth.gap)
    higher = moved[:, template.row(CHIN), 1] + LEAST_CHIN_DROP_SHARE * jaw_drop(mouth.gap) * (1 - mouth.tuck)
    moved[:, template.jaw, 1] -= np.maximum(higher, 0)[:, None]
    return PointMotion(moved, mouth)


def _part_lips(heights: Array, across: Array, gap: Array) -> Array:
    """Return how the points of both lips move up or down for a gap between their middles [shape=(T, 52)]."""
    template = mouth_template()
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
    moved = np.zeros_like(heights)
    moved[:, lips] = np.where(template.upper[lips], parted, -parted)
    moved[:, pairs[:, 0]], moved[:, pairs[:, 1]] = lacking[:, 1:-1] / 2, -lacking[:, 1:-1] / 2
    return moved


def _invent_points(motion: Motion, rest: NDArray[np.bool_], mouth: SpokenMouth) -> Array:
    """Return displacements of the points from distances alone [shape=(T, 52, 3)]."""
    template = mouth_template()
    across = np.clip(template.places[:, 0] / (template.width / 2), -1, 1)
    middle = np.sqrt(1 - across**2)
    rise = upper_share(mouth.gap)
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
