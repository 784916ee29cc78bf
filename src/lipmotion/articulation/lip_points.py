"""The lip and jaw points of a mouth at rest: where to look for them on a mesh, which are mirrored; symmetrical motion.

The table is the rest pose of the shipped model, made symmetrical: eye distances, in the head frame of motion (origin
between the eyes, x to the speaker's left, y up, z out of the face). Points have the numbers of MediaPipe's face mesh,
as in the names of the channels (``x_13``, ``y_13``, ``z_13``).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from lipmotion.storage.sources import read_shipped_table
from lipmotion.types import Motion

UPPER_MIDDLE, LOWER_MIDDLE = 13, 14  # the middles of the inner lips; the channel ``opening`` is their distance
RIGHT_CORNER, LEFT_CORNER = 61, 291  # the lip corners; the channel ``width`` is their distance
INNER_CORNERS = (78, 308)  # where the lips part, right and left
UPPER_EDGE, LOWER_EDGE = 0, 17  # the middles of the outer lips; the channel ``outer`` is their distance
CHIN = 152
FACING = ((13, 14), (82, 87), (312, 317), (81, 178), (311, 402))
"""Pairs of an upper and a lower point of the inner lips that touch when the mouth is closed."""


@dataclass(frozen=True, eq=False)
class MouthTemplate:
    """Lip and jaw points at rest."""

    points: tuple[int, ...]  # numbers of the 52 points, in the order of the rows
    places: NDArray[np.float64]  # [shape=(52, 3)], eye distances
    # which rows are what [each shape=(52,)]; a corner is neither upper nor lower
    upper: NDArray[np.bool_]
    lower: NDArray[np.bool_]
    corner: NDArray[np.bool_]
    jaw: NDArray[np.bool_]
    inner: NDArray[np.bool_]
    mirrored: NDArray[np.int64]  # the row of the point on the other side [shape=(52,)]

    def row(self, point: int) -> int:
        """Return the row of a point."""
        return self.points.index(point)

    @property
    def centre(self) -> NDArray[np.float64]:
        """The point between the lip corners [shape=(3,)]."""
        return (self.places[self.row(RIGHT_CORNER)] + self.places[self.row(LEFT_CORNER)]) / 2

    @property
    def width(self) -> float:
        """The distance of the lip corners, eye distances."""
        return float(np.linalg.norm(self.places[self.row(RIGHT_CORNER)] - self.places[self.row(LEFT_CORNER)]))

    def seam(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the height at which the closed lips meet, at some places from right to left [shape=(len(x),)]."""
        rows = np.flatnonzero(self.inner)
        order = rows[np.argsort(self.places[rows, 0], kind="stable")]
        return np.interp(x, self.places[order, 0], self.places[order, 1])


@cache
def build_mouth() -> MouthTemplate:
    """Return the template of the table ``lip_points.csv``."""
    rows = read_shipped_table("lipmotion.articulation", "lip_points.csv")
    points = tuple(int(row["point"]) for row in rows)
    return MouthTemplate(
        points,
        np.array([[float(row[axis]) for axis in "xyz"] for row in rows]),
        mirrored=np.array([points.index(int(row["mirrored"])) for row in rows]),
        **{kind: np.array([kind in row["place"] for row in rows]) for kind in "upper lower corner jaw inner".split()},
    )


BLOCK_FRAMES = 10_000
"""Frames that are computed at a time, so that hours of motion take little memory beside their copy."""


def make_symmetrical(motion: Motion, asymmetry: float = 0.0) -> Motion:
    """Return motion whose lip and jaw points move alike on both sides; distances and weights stay as they are.

    asymmetry : 0 to 1: the share that is left of the difference between the sides of the speaker's own mouth
    Points are in the head frame: x to the speaker's left, 0 between the eyes.
    """
    template, names = build_mouth(), {*motion.names}
    if asymmetry >= 1 or not names.issuperset(f"{axis}_{point}" for point in template.points for axis in "xyz"):
        return motion
    values = motion.values.copy()
    for axis, sign in (("x", -1.0), ("y", 1.0), ("z", 1.0)):
        columns = [motion.column(f"{axis}_{point}") for point in template.points]
        for start in range(0, len(values), BLOCK_FRAMES):
            places = values[start : start + BLOCK_FRAMES, columns]
            mean = (places + sign * places[:, template.mirrored]) / 2
            values[start : start + BLOCK_FRAMES, columns] = mean + asymmetry * (places - mean)
    return Motion(values, motion.rate_hz, motion.channels)
