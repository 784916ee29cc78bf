"""Light on the vertices of surfaces, and their normals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.choice import compiled_pays

Real = NDArray[np.float64]
NORMAL_S = 0.1e-6
"""Time that NumPy takes for the normal of a triangle."""
LEAST_FACING_COSINE = -0.35
"""Vertices that face further away than this (the cosine) are not seen, and stay dark."""


def normal_sums(places: Real, triangles: NDArray[np.int32]) -> Real:
    """Return the sum of the normals of the triangles around every vertex, twice as long as their areas [shape=(V, 3)].

    places : of the vertices [shape=(V, 3)];  triangles : counterclockwise from outside [shape=(F, 3)]
    Two forms of the same bits: a scene that is written once must not wait for numba.
    """
    total = np.zeros(places.shape)
    if compiled_pays(len(triangles) * NORMAL_S):
        from lipmotion.kernels.compiled import shading

        shading.add_normals(places, triangles, total)
        return total
    first, second, third = (places[triangles[:, corner]] for corner in range(3))
    across = np.cross(second - first, third - first)
    for axis in range(3):
        for corner in range(3):
            total[:, axis] += np.bincount(triangles[:, corner], across[:, axis], minlength=len(places))
    return total


def shade(
    normals: Real,
    places: Real,
    viewer: Real,
    colours: Real,
    reaches: Real,
    strands: Real,
    kinds: NDArray[np.intp],
    finishes: Real,
    lamps: Real,
) -> NDArray[np.float32]:
    """Return the light that vertices send to the viewer [shape=(V, 3)].

    normals, places : of the vertices, normals of length 1 [shape=(V, 3)];  viewer : his place [shape=(3,)]
    colours  : diffuse reflection of red, green and blue [shape=(V, 3)]
    reaches  : the parts of the sky and of the first lamp that are not hidden [shape=(V, 2)]
    strands  : directions of hair, of length 1 [shape=(V, 3)]
    kinds    : the row of ``finishes`` of every vertex [shape=(V,)]
    finishes : how far light reaches into the shade (red, green, blue); strength of highlights and how often their
               shape is squared; reflection at grazing angles; 1 where highlights run across strands [shape=(K, 7)]
    lamps    : direction and light of key, fill and two rim lights, then light of sky and ground [shape=(6, 6)]
    Powers are made by squaring.
    Source: Blinn 1977 (highlights), Kajiya & Kay 1989 (hair), half-Lambert with a width for each colour (skin).
    """
    from lipmotion.kernels.compiled import shading

    light = np.empty(normals.shape, np.float32)
    shading.shade(normals, places, viewer, colours, reaches, strands, kinds, finishes, lamps, light)
    return light
