"""Smooth outlines through few points: sequences of cubic Bézier curves, as arrays of points [shape=(N, 2)].

A path is the list of points that a curve goes through: pairs of numbers, or a text ``"x y, x y, ..."``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
Path = str | Sequence[tuple[float, float]]

STEPS = 16
"""Points drawn for each Bézier curve."""


def path_points(path: Path) -> Points:
    """Return the points of a path [shape=(N, 2)]: the corners of a polygon."""
    pairs = [pair.split() for pair in path.split(",")] if isinstance(path, str) else path
    return np.array(pairs, dtype=np.float64)


def closed_curve(path: Path) -> Points:
    """Return the smooth closed curve through the points of a path."""
    start = path_points(path)
    before, end, beyond = (np.roll(start, shift, axis=0) for shift in (1, -1, -2))
    return _chain(start, before, end, beyond)


def open_curve(path: Path) -> Points:
    """Return the smooth curve through the points of a path, from the first to the last."""
    points = path_points(path)
    before = np.vstack([2 * points[0] - points[1], points[:-2]])
    beyond = np.vstack([points[2:], 2 * points[-1] - points[-2]])
    return np.vstack([_chain(points[:-1], before, points[1:], beyond), points[-1:]])


def mirror_curve(path: Path) -> Points:
    """Return the smooth closed curve through a path down the right side and its mirror image.

    The path begins and ends on the axis x = 0.
    """
    right = path_points(path)
    return closed_curve([(x, y) for x, y in np.vstack([right, both_sides(right)[1][-2:0:-1]]).tolist()])


def stroke(line: Points, widths: Sequence[float]) -> Points:
    """Return the outline of a stroke along a line [shape=(N, 2)], with ``widths`` at even distances along it."""
    along = np.gradient(line, axis=0)
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(np.hypot(*along.T), 1e-9)[:, None]
    share = np.linspace(0, len(widths) - 1, len(line))
    half = np.interp(share, np.arange(len(widths)), np.asarray(widths) / 2)[:, None]
    return np.vstack([line + half * normal, (line - half * normal)[::-1]])


def ellipse(x: float, y: float, radius_x: float, radius_y: float) -> Points:
    """Return an ellipse about (x, y)."""
    angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    return np.stack([x + radius_x * np.cos(angle), y + radius_y * np.sin(angle)], axis=1)


def both_sides(right: Points) -> tuple[Points, Points]:
    """Return an outline and its mirror image on the other side of the face."""
    return right, right * np.array([-1.0, 1.0])


def move_down(points: Points, distance: float) -> Points:
    """Return the outline moved down by a distance."""
    return points + np.array([0.0, distance])


def _chain(start: Points, before: Points, end: Points, beyond: Points) -> Points:
    """Return Bézier curves from every ``start`` to its ``end``, with the tangents of Catmull and Rom 1974."""
    t = np.linspace(0, 1, STEPS, endpoint=False)[None, :, None]
    first, second = start + (end - before) / 6, end - (beyond - start) / 6
    p0, p1, p2, p3 = (p[:, None, :] for p in (start, first, second, end))
    curve = (1 - t) ** 3 * p0 + 3 * (1 - t) ** 2 * t * p1 + 3 * (1 - t) * t**2 * p2 + t**3 * p3
    return np.asarray(curve.reshape(-1, 2))
