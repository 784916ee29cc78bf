"""Light on vertices, for all of them at once."""

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.kernels.shading import MIN_FACING_COSINE

Real = NDArray[np.float64]


def shade(
    normals: Real, places: Real, viewer: Real, colours: Real, reaches: Real, strands: Real,
    kinds: NDArray[np.intp], finishes: Real, lamps: Real,
) -> NDArray[np.float32]:  # fmt: skip
    """Return what ``lipmotion_faces.kernels.shading.shade`` says, for all vertices at once."""
    finish = finishes[kinds]
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
    light[faces < MIN_FACING_COSINE] = 0
    return light.astype(np.float32)


def _bounced(arrives: Real, colour: Real) -> Real:
    """Return the light that arrives together with what the surface near by sends on, in its own colour."""
    return arrives * (1.0 + colour * (1.0 - arrives))


def _dot(a: Real, b: Real) -> Real:
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])
