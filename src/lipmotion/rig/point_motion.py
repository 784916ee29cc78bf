"""Motion as a character needs it: how lip and jaw points leave the rest pose, and how far the lips are apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.rig.blendshape_motion import with_mouth
from lipmotion.rig.mouth_template import CHIN, LOWER_MIDDLE, UPPER_MIDDLE, mouth_template
from lipmotion.types import Motion, Timeline, Unit
from lipmotion.units import is_silent

Array = NDArray[np.float64]

CLOSED_BELOW = 0.012
"""Tracked lips that touch have openings up to this, in eye distances; the gap is 0 up to it."""
LARGEST_REST = 0.06
"""A rest pose more open than this is taken for speech: the recording has hardly any silence."""
FAITHFUL_FROM = 2.5
"""From this many times the closed opening on, the gap is the opening; below, it goes down to 0 linearly."""
UPPER_SHARE, UPPER_MOST = 0.3, 0.06
"""Where only distances are known: the share of the gap that the upper lip rises, and its most, in eye distances."""
JAW_SHARE = 0.85
"""And the share of the lower lip's way that the chin goes."""


@dataclass(frozen=True, eq=False)
class PointMotion:
    """Lip and jaw points over time, away from the rest pose.

    displacements : of the 52 points of the template, in its order, eye distances, head frame [shape=(T, 52, 3)]
    gap           : distance between the inner lips; 0 where they touch, as in silence and in p b m [shape=(T,)]
    rate_hz       : frames per second
    """

    displacements: Array
    gap: Array
    rate_hz: float

    def scaled(self, factor: float) -> PointMotion:
        """Return the same motion, so many times as large; lips that touch still touch."""
        return PointMotion(factor * self.displacements, factor * self.gap, self.rate_hz)


def point_motion(motion: Motion, units: Timeline[Unit]) -> PointMotion:
    """Return the motion of lip and jaw points away from the rest pose, which is that of the silences.

    Motion that has points is taken as it is; of motion with distances alone (``opening``, perhaps ``width``, ``outer``)
    the points are made up, as mouths usually move. Motion of blendshapes alone moves the mouth of ``reference_mouth``.
    units : phones in time; without silence, the tenth of the frames that is most closed is the rest pose
    Raises InputError: no frames, no channel ``opening``, or values that are not finite.
    """
    if not len(motion.values):
        raise InputError("the motion has no frames; there is nothing to move a character by")
    motion = with_mouth(motion)
    if "opening" not in motion.names:
        raise InputError(f"no channel 'opening' to move a character by among: {', '.join(motion.names[:6])}")
    if not np.isfinite(motion.values).all():
        raise InputError("the motion has values that are not finite; interpolate the missing frames first")
    rest = rest_frames(motion, units)
    gap = lip_gap(motion["opening"].astype(np.float64), rest)
    template = mouth_template()
    names = [[f"{axis}_{point}" for axis in "xyz"] for point in template.points]
    if all(name in motion.names for row in names for name in row):
        places = np.stack([np.stack([motion[name] for name in row], axis=1) for row in names], axis=1).astype(
            np.float64
        )
        displacements = places - np.median(places[rest], axis=0)
    else:
        displacements = _made_up(motion, rest, gap)
    return PointMotion(displacements, gap, motion.rate_hz)


def closed_displacements(points: PointMotion) -> Array:
    """Return the displacements with the inner lips apart by the gap of the motion [shape=(T, 52, 3)].

    The middle of the lips of a person at rest is not wholly closed; both lips share the correction.
    """
    template = mouth_template()
    moved = points.displacements.copy()
    upper, lower = (np.flatnonzero(side & template.inner) for side in (template.upper, template.lower))
    middle = (template.row(UPPER_MIDDLE), template.row(LOWER_MIDDLE))
    correction = points.gap - (moved[:, middle[0], 1] - moved[:, middle[1], 1])
    across = 1 - np.abs(template.places[:, 0]) / (template.width / 2)
    moved[:, upper, 1] += np.outer(correction / 2, across[upper])
    moved[:, lower, 1] -= np.outer(correction / 2, across[lower])
    moved[:, middle[0], 1] += correction / 2 * (1 - across[middle[0]])
    moved[:, middle[1], 1] -= correction / 2 * (1 - across[middle[1]])
    return moved


def rest_frames(motion: Motion, units: Timeline[Unit]) -> NDArray[np.bool_]:
    """Return the frames of the rest pose: silence, or else the tenth of the frames that is most closed [shape=(T,)]."""
    time_s, opening = motion.time_s, motion["opening"]
    rest = np.zeros(len(time_s), dtype=bool)
    for span in units:
        if is_silent(span.label.phone):
            rest |= (span.start_s <= time_s) & (time_s < span.end_s)
    if rest.any() and float(np.median(opening[rest])) <= LARGEST_REST:
        return rest
    rest = np.zeros(len(time_s), dtype=bool)
    rest[np.argsort(opening, kind="stable")[: max(1, len(time_s) // 10)]] = True
    return rest


def lip_gap(opening: Array, rest: NDArray[np.bool_]) -> Array:
    """Return how far the lips are apart [shape=(T,)]: 0 at rest and where lips touch, the opening where it is large."""
    closed = max(CLOSED_BELOW, min(float(np.median(opening[rest])), LARGEST_REST))
    rising = (opening - closed) * (FAITHFUL_FROM / (FAITHFUL_FROM - 1))
    return np.maximum(np.minimum(opening, rising), 0.0)


def _made_up(motion: Motion, rest: NDArray[np.bool_], gap: Array) -> Array:
    """Return displacements of the points from distances alone [shape=(T, 52, 3)]."""
    template = mouth_template()
    half = template.width / 2
    across = np.clip(template.places[:, 0] / half, -1, 1)
    middle = np.sqrt(1 - across**2)
    rise = np.minimum(UPPER_SHARE * gap, UPPER_MOST)
    drop = gap - rise
    moved = np.zeros((len(gap), len(template.points), 3))
    moved[:, template.upper, 1] = np.outer(rise, middle[template.upper])
    moved[:, template.lower, 1] = -np.outer(drop, middle[template.lower])
    moved[:, template.jaw, 1] = -JAW_SHARE * drop[:, None]
    moved[:, template.corner, 1] = -0.3 * drop[:, None]
    if "width" in motion.names:
        wider = motion["width"] - np.median(motion["width"][rest])
        moved[:, ~template.jaw, 0] = np.outer(wider / 2, across[~template.jaw])
    if "outer" in motion.names:
        thicker = (motion["outer"] - motion["opening"]) / 2
        thicker = thicker - np.median(thicker[rest])
        edges = ~template.inner & ~template.corner & ~template.jaw
        moved[:, edges, 1] += np.outer(thicker, np.where(template.upper, middle, -middle)[edges])
    if f"y_{CHIN}" in motion.names:
        chin = motion[f"y_{CHIN}"]
        moved[:, template.jaw, 1] = (chin - np.median(chin[rest]))[:, None]
    return moved
