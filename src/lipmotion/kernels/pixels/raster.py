"""Triangles to pixels: a depth buffer with four samples a pixel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Colours = NDArray[np.float32]
GRID = 256.0
"""Corners are rounded to this part of a sample, so that neighbouring triangles leave no gap between them."""


def draw(
    points: Real,
    colours: Colours,
    triangles: NDArray[np.int32],
    area: tuple[int, int, int, int],
    background: Colours,
    tone: NDArray[np.uint8],
    picture: NDArray[np.uint8],
) -> None:
    """Draw triangles over the background into an area of a picture, in place.

    points     : column and row in pixels, and depth (smaller is nearer) of every vertex [shape=(V, 3)]
    colours    : of every vertex, light as a physicist measures it, 0 to 1 [shape=(V, 3)]
    triangles  : counterclockwise on the screen where they face the viewer; others are not drawn [shape=(F, 3)]
    area       : first column and row, and the column and row behind the last ones
    background : light in every pixel [shape=(H, W, 3)]
    tone       : the grey level of light from 0 to 1, in even steps [shape=(L,)]
    picture    : is changed in the area alone [shape=(H, W, 3)]
    It runs without the interpreter's lock where numba is there.
    """
    x, y = (np.rint(2 * GRID * points[:, axis]) / GRID for axis in range(2))
    z = np.ascontiguousarray(points[:, 2])
    from lipmotion.kernels.compiled import raster

    raster.draw(x, y, z, colours, triangles, np.array(area), background, tone, picture)
