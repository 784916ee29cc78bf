"""Light on the vertices of surfaces, and their normals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.choice import compiled_pays

Real = NDArray[np.float64]
LEAST_FACING_COSINE = -0.35
"""Vertices that face further away than this (the cosine) are not seen, and stay dark."""
VERTEX_S = 1.2e-6
"""Time that NumPy takes for a vertex."""
NORMAL_S = 0.1e-6
"""Time that NumPy takes for the normal of a triangle."""


def normal_sums(places: Real, triangles: NDArray[np.int32]) -> Real:
    """Return the sum of the normals of the triangles around every vertex, twice as long as their areas [shape=(V, 3)].

    places : of the vertices [shape=(V, 3)];  triangles : counterclockwise from outside [shape=(F, 3)]
    Both forms add in the same order.
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
    Both forms compute the same bits: powers are made by squaring.
    Source: Blinn 1977 (highlights), Kajiya & Kay 1989 (hair), half-Lambert with a width for each colour (skin).
    """
    if compiled_pays(len(normals) * VERTEX_S):
        from lipmotion.kernels.compiled import shading

        light = np.empty(normals.shape, np.float32)
        shading.shade(normals, places, viewer, colours, reaches, strands, kinds, finishes, lamps, light)
        return light
    return _shade(normals, places, viewer, colours, reaches, strands, finishes[kinds], lamps)


def _shade(
    normals: Real, places: Real, viewer: Real, colours: Real, reaches: Real, strands: Real, finish: Real, lamps: Real
) -> NDArray[np.float32]:
    eye = viewer - places
    eye = eye / np.sqrt(_dot(eye, eye))[:, None]
    faces = _dot(normals, eye)
    grazing = np.minimum(np.maximum(1.0 - faces, 0.0), 1.0)
    grazing2 = grazing * grazing
    open_sky, direct = reaches[:, 0], reaches[:, 1]
    up = 0.5 + 0.5 * normals[:, 1]
    diffuse = [_bounced(open_sky, colours[:, c]) * (up * lamps[4, c] + (1.0 - up) * lamps[5, c]) for c in range(3)]
    edge = finish[:, 5] * grazing2 * grazing2 * open_sky
    shine = [edge * lamps[4, c] for c in range(3)]
    for n in range(2):
        towards, arrives = lamps[n, :3], direct if n == 0 else open_sky
        facing = _dot(normals, towards[None])
        half = eye + towards
        length = np.sqrt(_dot(half, half))
        along = _dot(strands, half) / length
        across = np.where(
            finish[:, 6] > 0, np.sqrt(np.maximum(1.0 - along * along, 0)), np.maximum(_dot(normals, half) / length, 0)
        )
        for step in range(int(finish[:, 4].max(initial=0))):
            across = np.where(step < finish[:, 4], across * across, across)
        glint = finish[:, 3] * across * np.minimum(np.maximum(4.0 * facing + 0.3, 0.0), 1.0) * arrives
        for c in range(3):
            soft = np.maximum(facing + finish[:, c], 0.0) / (1.0 + finish[:, c])
            diffuse[c] = diffuse[c] + soft * np.sqrt(soft) * _bounced(arrives, colours[:, c]) * lamps[n, 3 + c]
            glare = glint * lamps[n, 3 + c]
            glare = np.where(finish[:, 6] > 0, glare * (4.0 * colours[:, c]), glare)
            shine[c] = shine[c] + np.where(finish[:, 3] > 0, glare, 0.0)
    for n in range(2, 4):
        rim = np.maximum(_dot(normals, lamps[n, None, :3]), 0.0) * grazing2 * open_sky
        for c in range(3):
            diffuse[c] = diffuse[c] + 0.9 * rim * lamps[n, 3 + c]
            shine[c] = shine[c] + 0.12 * rim * lamps[n, 3 + c]
    light = np.stack([colours[:, c] * diffuse[c] + shine[c] for c in range(3)], axis=1)
    light[faces < LEAST_FACING_COSINE] = 0
    return light.astype(np.float32)


def _bounced(arrives: Real, colour: Real) -> Real:
    """Return the light that arrives together with what the surface near by sends on, in its own colour."""
    return arrives * (1.0 + colour * (1.0 - arrives))


def _dot(a: Real, b: Real) -> Real:
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])
