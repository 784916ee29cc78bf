"""How much of the sky and of the key light reaches every vertex of a still surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.rendering.lighting import KEY, unit

Real = NDArray[np.float64]

CELL = 0.045
"""Size of the cells in which the nearest surface is kept, in the unit of the vertices."""
BIAS_DISTANCE, FADE_DISTANCE = 0.05, 0.10
"""A vertex this far behind another one begins to be hidden, and is hidden this much further behind."""


def reaches(
    places: Real,
    normals: Real,
    triangles: NDArray[np.int32],
    hiding: NDArray[np.bool_],
    *,
    directions: int = 72,
    lamps: int = 20,
) -> Real:
    """Return the parts of the sky and of the key light that reach the vertices, 0 to 1 [shape=(V, 2)].

    places, normals : of the vertices, which must be dense: no further apart than ``CELL`` [shape=(V, 3)]
    triangles  : along which the result is smoothed [shape=(F, 3)]
    hiding     : which of them hide others [shape=(V,)]
    directions : number of directions of the sky;  lamps : number of places on the key light, which is large and soft
    Cost: O(V · directions).
    """
    towards = _sphere(directions)
    total, seen = np.zeros(len(places)), np.zeros(len(places))
    for way in towards:
        weight = np.maximum(normals @ way + 0.1, 0) * (1.2 + way[1])
        total += weight
        seen += weight * _visible(places, hiding, way)
    sky = seen / np.maximum(total, 1e-9)
    key = unit(np.array(KEY.towards))
    around = np.cross(key, [0.0, 1.0, 0.0])
    above = np.cross(around, key)
    direct = np.zeros(len(places))
    for n in range(lamps):
        radius, angle = 0.22 * np.sqrt((n + 0.5) / lamps), 2.39996 * n
        direct += _visible(places, hiding, unit(key + radius * (np.cos(angle) * around + np.sin(angle) * above)))
    return _smoothed(np.stack([sky, direct / lamps], axis=1), triangles)


def _smoothed(values: Real, triangles: NDArray[np.int32], times: int = 4) -> Real:
    """Return values of vertices as means over the triangles around them [shape=(V, 2)]."""
    count = np.maximum(np.bincount(triangles.ravel(), minlength=len(values)), 1)[:, None]
    for _ in range(times):
        mean = values[triangles].mean(axis=1)
        total = np.stack(
            [
                sum(np.bincount(triangles[:, corner], mean[:, k], minlength=len(values)) for corner in range(3))
                for k in range(values.shape[1])
            ],
            axis=1,
        )
        values = total / count
    return values


def _sphere(count: int) -> Real:
    """Return directions that are spread evenly over the sphere [shape=(count, 3)]."""
    y = 1 - (2 * np.arange(count) + 1) / count
    angle = 2.39996 * np.arange(count)
    flat = np.sqrt(1 - y * y)
    return np.stack([flat * np.cos(angle), y, flat * np.sin(angle)], axis=1)


def _visible(places: Real, hiding: NDArray[np.bool_], way: Real) -> Real:
    """Return how far every vertex can be seen from a direction, 0 to 1 [shape=(V,)]."""
    side = unit(np.cross(way, [0.31, 0.9, 0.27]))
    flat = np.stack([places @ side, places @ np.cross(side, way)], axis=1) / CELL
    flat -= flat.min(axis=0) - 1
    height = places @ way
    size = int(flat.max()) + 3
    nearest = np.full((size, size), -1e9)
    cells = np.rint(flat[hiding]).astype(int)
    np.maximum.at(nearest, (cells[:, 0], cells[:, 1]), height[hiding])
    low = np.floor(flat).astype(int)
    share = flat - low
    seen = np.zeros(len(places))
    for i in range(2):
        for j in range(2):
            weight = np.abs(1 - i - share[:, 0]) * np.abs(1 - j - share[:, 1])
            above = nearest[low[:, 0] + i, low[:, 1] + j] - height
            seen += weight * np.clip(1 - (above - BIAS_DISTANCE) / FADE_DISTANCE, 0, 1)
    return seen
