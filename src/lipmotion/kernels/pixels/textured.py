"""Triangles with textures to pixels: what each sample shows is found first, and then shaded once a pixel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.pixels.raster import GRID

Real = NDArray[np.float64]
Light = NDArray[np.float32]
Whole = NDArray[np.int32]

SOLID, CUT, CLEAR = 0, 1, 2
"""Kinds of triangles: without holes; with holes where the texture is clear; blended with what is behind."""
HIDING_OPACITY = 0.95
"""From this opacity on, a blended surface hides what is behind it."""
SEEN_OPACITY = 1 / 512
"""Below this opacity, it is not seen."""
NO_TRIANGLE = -1
SCALE = 1 / 65535


class TexturedTriangles(NamedTuple):
    """Triangles, and how their textures lie on them.

    triangles : counterclockwise from outside [shape=(F, 3)]
    uv        : place of every corner in the texture, v downwards, repeated beyond 0 to 1 [shape=(F, 3, 2)]
    looks     : the row of ``levels`` or -1 for no texture, and the kind: ``SOLID``, ``CUT``, ``CLEAR`` [shape=(F, 2)]
    alphas    : the opacity below which there is a hole, and the opacity by which that of the texture is multiplied
                [shape=(F, 2)]
    texels    : light that is reflected, and opacity, 0 to 65535 [shape=(N, 4)]
    levels    : first texel, width and height of each texture [shape=(L, 3)]
    """

    triangles: Whole
    uv: Real
    looks: Whole
    alphas: Real
    texels: NDArray[np.uint16]
    levels: NDArray[np.int64]


def draw_textured(
    points: Real,
    light: Light,
    shine: Light,
    surface: TexturedTriangles,
    area: tuple[int, int, int, int],
    background: Light,
    tone: NDArray[np.uint8],
    picture: NDArray[np.uint8],
    opacity: NDArray[np.uint8],
) -> None:
    """Draw triangles over the background into an area of a picture, in place.

    points  : column and row in pixels, and depth: -1 divided by the distance [shape=(V, 3)]
    light   : of every vertex, what a white surface sends to the viewer [shape=(V, 3)];  shine : its highlights, which
              have no colour of the surface [shape=(V, 3)]
    area    : first column and row, and the column and row behind the last ones
    background : light in every pixel [shape=(H, W, 3)]
    tone    : the grey level of light from 0 to 1, in even steps [shape=(L,)]
    picture : is changed in the area alone [shape=(H, W, 3)]
    opacity : becomes the part of each pixel that triangles hide, 0 to 255, in the area alone [shape=(H, W)]
    Of surfaces that are blended, the nearest one is seen before what is solid. A texture is sampled once a pixel and
    triangle, bilinearly. It runs without the interpreter's lock where numba is there.
    """
    x, y = (np.rint(2 * GRID * points[:, axis]) / GRID for axis in range(2))
    z = np.ascontiguousarray(points[:, 2])
    from lipmotion.kernels.compiled import textured

    textured.draw(x, y, z, light, shine, *surface, np.array(area), background, tone, picture, opacity)
