"""Solid forms as distance functions: the head is a smooth union of a few ellipsoids, cones and balls.

Unit: eye distances (outer corners); x to the character's left, y up, z out of the face, origin between the eyes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Form = Callable[[Real], Real]
"""The signed distance of places [shape=(N, 3)] from a surface, negative inside [shape=(N,)]."""

EYE = np.array([0.315, 0.0, -0.215])
"""Centre of the left eyeball; the right one is its mirror image."""
EYEBALL_RADIUS, LID_RADIUS = 0.225, 0.243
"""Radii of the eyeball and of the skin upon it."""
MOUTH_Y = -0.70
"""Height of the line between the lips."""
MIDDLE = np.array([0.0, -0.3, -0.75])
"""A place inside the head from which every place of the skin can be seen."""


def ellipsoid(p: Real, centre: tuple[float, float, float], radii: tuple[float, float, float]) -> Real:
    """Return the approximate distance from an ellipsoid. Source: Quilez, "Distance functions"."""
    away = p - np.array(centre)
    first = np.linalg.norm(away / np.array(radii), axis=1)
    second = np.linalg.norm(away / np.array(radii) ** 2, axis=1)
    return np.asarray(first * (first - 1) / np.maximum(second, 1e-9))


def cone(p: Real, a: tuple[float, float, float], b: tuple[float, float, float], ra: float, rb: float) -> Real:
    """Return the approximate distance from a rounded cone between two balls."""
    start, axis = np.array(a), np.array(b) - np.array(a)
    along = np.clip((p - start) @ axis / (axis @ axis), 0, 1)
    return np.asarray(np.linalg.norm(p - start - along[:, None] * axis, axis=1) - (ra + along * (rb - ra)))


def union(a: Real, b: Real, blend: float) -> Real:
    """Return the distance from two forms whose joint is rounded over a width of ``blend``."""
    share = np.maximum(blend - np.abs(a - b), 0) / blend
    return np.asarray(np.minimum(a, b) - share * share * blend / 4)


def cut(a: Real, b: Real, blend: float) -> Real:
    """Return the distance from the first form without the second one, with a rounded edge."""
    return -union(-a, b, blend)


def head(p: Real) -> Real:
    """Return the distance from the skin of the head without neck, lips, eyes open or shut, and ears."""
    q = p.copy()
    q[:, 0] = np.abs(q[:, 0])
    d = ellipsoid(q, (0, 0.34, -0.80), (0.83, 0.92, 0.93))
    d = union(d, ellipsoid(q, (0, -0.30, -0.60), (0.72, 0.78, 0.60)), 0.35)
    d = union(d, ellipsoid(q, (0.34, -0.35, -0.33), (0.30, 0.27, 0.32)), 0.3)
    d = union(d, cone(q, (0.0, -0.95, -0.27), (0.33, -0.60, -0.62), 0.16, 0.22), 0.35)
    d = union(d, ellipsoid(q, (0, -0.98, -0.185), (0.19, 0.14, 0.16)), 0.22)
    d = union(d, ellipsoid(q, (0, -0.71, -0.17), (0.36, 0.27, 0.22)), 0.25)
    d = cut(d, ellipsoid(q, (0.335, 0.0, 0.115), (0.27, 0.2, 0.14)), 0.2)
    d = union(d, np.linalg.norm(q - EYE, axis=1) - LID_RADIUS, 0.05)
    d = union(d, cone(q, (0, 0.10, -0.07), (0, -0.35, 0.10), 0.052, 0.078), 0.14)
    d = union(d, ellipsoid(q, (0, -0.40, 0.135), (0.092, 0.082, 0.095)), 0.1)
    d = union(d, ellipsoid(q, (0.094, -0.43, 0.045), (0.06, 0.055, 0.075)), 0.06)
    d = cut(d, ellipsoid(q, (0.052, -0.495, 0.105), (0.034, 0.026, 0.05)), 0.025)
    return cut(d, ellipsoid(q, (0, -0.57, 0.08), (0.036, 0.07, 0.036)), 0.09)


def along_rays(form: Form, start: Real, direction: Real, *, steps: int = 70) -> Real:
    """Return how far rays from outside [shape=(N, 3)], in a direction of length 1, go until they meet a form
    [shape=(N,)].
    """
    far, going = np.zeros(len(start)), np.arange(len(start))
    for _ in range(steps):
        gap = form(start[going] + far[going, None] * direction[going])
        far[going] += 0.8 * gap
        going = going[np.abs(gap) > 1e-5]
        if not len(going):
            break
    return far


def seen_from_front(form: Form, x: Real, y: Real) -> Real:
    """Return the z of a form's frontmost place at columns and heights [shape=(N,), both]."""
    start = np.stack([x, y, np.full(len(x), 1.0)], axis=1)
    return np.asarray(1 - along_rays(form, start, np.broadcast_to([0.0, 0.0, -1.0], start.shape)))


def seen_from_middle(form: Form, directions: Real) -> Real:
    """Return the places of a form in directions from ``MIDDLE`` [shape=(N, 3)]."""
    far = along_rays(form, MIDDLE + 3 * directions, -directions, steps=90)
    return np.asarray(MIDDLE + (3 - far)[:, None] * directions)


def outward(form: Form, places: Real) -> Real:
    """Return the normals of a form at places on it [shape=(N, 3)], of length 1."""
    step = 2e-3
    slope = np.stack([form(places + step * axis) - form(places - step * axis) for axis in np.eye(3)], axis=1)
    return np.asarray(slope / np.linalg.norm(slope, axis=1, keepdims=True))
