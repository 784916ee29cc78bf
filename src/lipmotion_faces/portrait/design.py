"""What tells one drawn character from another: colours, proportions, hair. The drawing itself is the same for all.

Lengths are in eye distances: origin between the eyes, x to the right, y downwards. Paths are lists of points that a
smooth curve goes through: pairs of numbers, or a text ``"x y, x y, ..."``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
Path = str | Sequence[tuple[float, float]]

STEPS = 16  # points drawn for each Bézier curve


def list_path_points(path: Path) -> Points:
    """Return the points of a path [shape=(N, 2)]: the corners of a polygon."""
    pairs = [pair.split() for pair in path.split(",")] if isinstance(path, str) else path
    return np.array(pairs, dtype=np.float64)


def close_curve(path: Path) -> Points:
    """Return the smooth closed curve through the points of a path."""
    start = list_path_points(path)
    before, end, beyond = (np.roll(start, shift, axis=0) for shift in (1, -1, -2))
    return _chain_curves(start, before, end, beyond)


def open_curve(path: Path) -> Points:
    """Return the smooth curve through the points of a path, from the first to the last."""
    points = list_path_points(path)
    before = np.vstack([2 * points[0] - points[1], points[:-2]])
    beyond = np.vstack([points[2:], 2 * points[-1] - points[-2]])
    return np.vstack([_chain_curves(points[:-1], before, points[1:], beyond), points[-1:]])


def mirror_curve(path: Path) -> Points:
    """Return the smooth closed curve through a path down the right side, from x = 0 to x = 0, and its mirror image."""
    right = list_path_points(path)
    return close_curve([(x, y) for x, y in np.vstack([right, mirror_outline(right)[1][-2:0:-1]]).tolist()])


def stroke(line: Points, widths: Sequence[float]) -> Points:
    """Return the outline of a stroke along a line [shape=(N, 2)], with ``widths`` at even distances along it."""
    along = np.gradient(line, axis=0)
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(np.hypot(*along.T), 1e-9)[:, None]
    share = np.linspace(0, len(widths) - 1, len(line))
    half = np.interp(share, np.arange(len(widths)), np.asarray(widths) / 2)[:, None]
    return np.vstack([line + half * normal, (line - half * normal)[::-1]])


def make_ellipse(x: float, y: float, radius_x: float, radius_y: float, count: int = 64) -> Points:
    """Return so many points of an ellipse about (x, y) [shape=(count, 2)]."""
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return np.stack([x + radius_x * np.cos(angle), y + radius_y * np.sin(angle)], axis=1)


def mirror_outline(right: Points) -> tuple[Points, Points]:
    """Return an outline and its mirror image on the other side of the face."""
    return right, right * np.array([-1.0, 1.0])


def move_down(points: Points, distance: float) -> Points:
    """Return the outline moved down by a distance."""
    return points + np.array([0.0, distance])


def _chain_curves(start: Points, before: Points, end: Points, beyond: Points) -> Points:
    """Return Bézier curves from every ``start`` to its ``end``, with the tangents of Catmull and Rom 1974."""
    t = np.linspace(0, 1, STEPS, endpoint=False)[None, :, None]
    first, second = start + (end - before) / 6, end - (beyond - start) / 6
    p0, p1, p2, p3 = (p[:, None, :] for p in (start, first, second, end))
    curve = (1 - t) ** 3 * p0 + 3 * (1 - t) ** 2 * t * p1 + 3 * (1 - t) * t**2 * p2 + t**3 * p3
    return np.asarray(curve.reshape(-1, 2))


Colour = tuple[int, int, int]
Knots = tuple[tuple[float, float], ...]
"""Points of the edge of a lid of the right eye, from the inner to the outer corner."""
WHITE: Colour = (255, 255, 255)


@dataclass(frozen=True)
class LipDesign:
    """Lips.

    line_y       : height of the line where the closed lips meet
    half_width   : half the distance of the corners at rest
    seam         : half the thickness of the line between the closed lips
    smile        : how far the corners lie below the middle; negative: above. Round, oval and tucked lips have none
    outline      : thickness of a line around lips and mouth; 0: none
    """

    line_y: float = 0.9
    half_width: float = 0.3
    upper: float = 0.08
    lower: float = 0.118
    seam: float = 0.0065
    smile: float = 0.0
    outline: float = 0.0


@dataclass(frozen=True)
class EyeDesign:
    """Eyes and brows.

    iris         : its radius
    upper, lower : lids of the right eye, from the inner to the outer corner, one x for both
    lashes       : thickness of the upper lashes, relative to the woman's; over 0.5 with a wing
    brow         : line of the right brow, from the inner to the outer end
    brow_widths  : its thickness at even distances
    """

    x: float = 0.345
    y: float = -0.014
    iris: float = 0.1
    upper: Knots = ((0.175, 0.03), (0.245, -0.053), (0.35, -0.093), (0.455, -0.073), (0.51, -0.012))
    lower: Knots = ((0.175, 0.03), (0.26, 0.062), (0.37, 0.071), (0.465, 0.04), (0.51, -0.012))
    lashes: float = 1.0
    brow: Path = "0.155 -0.262, 0.28 -0.288, 0.42 -0.296, 0.575 -0.25"
    brow_widths: tuple[float, ...] = (0.014, 0.038, 0.044, 0.034, 0.006)


@dataclass(frozen=True, eq=False)
class Lock:
    """A part of the hair before the forehead: outline, (x, y, radius x, radius y) of its light or None, lines in it."""

    outline: Points
    light: tuple[float, float, float, float] | None = None
    strands: tuple[Path, ...] = ()


@dataclass(frozen=True, eq=False)
class Design:
    """A character.

    palette     : its colours, by name
    head        : the outline of the bald head, down its right side from x = 0 to x = 0
    neck, shoulders, collar : outlines; the collar is of light cloth over the shoulders
    ear, ear_hollow : outlines on the right side
    hair        : in front of the forehead
    hair_behind : behind head and neck; None: none
    cap         : hair on the sides and the back of the head, behind the ears; None: none
    nose_width  : relative to the woman's
    beard       : strength of the shade of a shaved beard, 0..1
    blush       : strength of the red of the cheeks, 0..1
    line        : thickness of lines around surfaces of one colour; 0: surfaces are shaded and have no lines
    """

    palette: SimpleNamespace
    head: Path
    neck: Points
    shoulders: Points
    lips: LipDesign = field(default_factory=LipDesign)
    eyes: EyeDesign = field(default_factory=EyeDesign)
    ear: Path = "0.7 0, 0.8 -0.07, 0.875 0, 0.87 0.17, 0.82 0.34, 0.77 0.42, 0.7 0.38"
    ear_hollow: Path = "0.765 0.05, 0.81 0.01, 0.835 0.07, 0.825 0.17, 0.79 0.26, 0.765 0.2"
    collar: tuple[Points, ...] = ()
    hair: tuple[Lock, ...] = ()
    hair_behind: Points | None = None
    cap: Points | None = None
    earrings: bool = False
    collarbones: bool = False
    nose_width: float = 1.0
    beard: float = 0.0
    blush: float = 0.34
    line: float = 0.0

    @property
    def flat(self) -> bool:
        """Whether surfaces have one colour, and a line around them."""
        return self.line > 0

    @property
    def skull(self) -> Points:
        """The outline of the bald head."""
        return mirror_curve(self.head)
