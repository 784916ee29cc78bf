"""Normals of vertices: compiled, and in NumPy for a scene written once, which must not wait for numba."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiler import compiled, pays

Real = NDArray[np.float64]


def sum_normals(places: Real, triangles: NDArray[np.int32]) -> Real:
    """Return the sum of the normals of the triangles around every vertex, twice as long as their areas [shape=(V, 3)].

    places : of the vertices [shape=(V, 3)];  triangles : counterclockwise from outside [shape=(F, 3)]
    Both forms give the same bits.
    """
    total = np.zeros(places.shape)
    if pays():
        _add_normals(places, triangles, total)
        return total
    first, second, third = (places[triangles[:, corner]] for corner in range(3))
    across = np.cross(second - first, third - first)
    for axis in range(3):
        for corner in range(3):
            total[:, axis] += np.bincount(triangles[:, corner], across[:, axis], minlength=len(places))
    return total


@compiled
def _add_normals(places: Real, triangles: NDArray[np.int32], total: Real) -> None:
    """Add the normals of triangles to those of their vertices, corner after corner."""
    part = np.empty(total.shape)
    across = np.empty((len(triangles), 3))
    for f in range(len(triangles)):
        a, b, c = triangles[f]
        bx, by, bz = places[b, 0] - places[a, 0], places[b, 1] - places[a, 1], places[b, 2] - places[a, 2]
        cx, cy, cz = places[c, 0] - places[a, 0], places[c, 1] - places[a, 1], places[c, 2] - places[a, 2]
        across[f, 0], across[f, 1], across[f, 2] = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    for corner in range(3):
        part[:] = 0.0
        for f in range(len(triangles)):
            v = triangles[f, corner]
            part[v, 0] += across[f, 0]
            part[v, 1] += across[f, 1]
            part[v, 2] += across[f, 2]
        total += part
