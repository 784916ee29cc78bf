"""Triangles to pixels, compiled: the pictures are those of ``kernels.raster`` to the bit."""

# Functions take their arrays as separate arguments, more than eight in places: numba compiles that to the fastest code.

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiled.compiler import compiled

Real = NDArray[np.float64]
Colours = NDArray[np.float32]
FAR = np.float32(np.inf)
BAND = 16
"""Rows of pixels that are drawn at once: their samples fit the processor's cache."""


@compiled
def draw(
    x: Real, y: Real, z: Real, colours: Colours, triangles: NDArray[np.int32], area: NDArray[np.intp],
    background: Colours, tone: NDArray[np.uint8], picture: NDArray[np.uint8],
) -> None:  # fmt: skip
    """Draw triangles over the background into an area of a picture, in place; arguments as of ``kernels.raster``."""
    left, top, right, bottom = area
    faces = np.empty(len(triangles), np.intp)
    rows = np.empty((len(triangles), 2), np.int32)
    count = 0
    for f in range(len(triangles)):
        a, b, c = triangles[f]
        if (x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a]) < 0:
            rows[count, 0] = np.int32(np.floor(min(y[a], y[b], y[c])))
            rows[count, 1] = np.int32(np.ceil(max(y[a], y[b], y[c])))
            faces[count] = f
            count += 1
    width = right - left
    depth = np.empty((2 * BAND, 2 * width), np.float32)
    colour = np.empty((2 * BAND, 2 * width, 3), np.float32)
    for first in range(top, bottom, BAND):
        last = min(first + BAND, bottom)
        depth[:] = FAR
        for n in range(count):
            if rows[n, 0] < 2 * last and rows[n, 1] > 2 * first:
                a, b, c = triangles[faces[n]]
                _triangle(x, y, z, colours, a, b, c, 2 * left, 2 * right, 2 * first, 2 * last, depth, colour)
        _resolve(depth, colour, background, tone, picture, left, right, first, last)


@compiled
def _triangle(
    x: Real, y: Real, z: Real, colours: Colours, a: int, b: int, c: int, left: int, right: int, top: int, bottom: int,
    depth: Colours, colour: Colours,
) -> None:  # fmt: skip
    # The corners are in whole 1/256 of a sample, so that the edge functions are exact.
    xa, ya, xb, yb, xc, yc = x[a], y[a], x[c], y[c], x[b], y[b]  # clockwise on the screen, whose rows go down
    b, c = c, b
    x0, x1 = max(left, int(np.floor(min(xa, xb, xc)))), min(right, int(np.ceil(max(xa, xb, xc))))
    y0, y1 = max(top, int(np.floor(min(ya, yb, yc)))), min(bottom, int(np.ceil(max(ya, yb, yc))))
    inverse = 1.0 / ((xb - xa) * (yc - ya) - (xc - xa) * (yb - ya))
    bias_a, bias_b, bias_c = _bias(xb, yb, xc, yc), _bias(xc, yc, xa, ya), _bias(xa, ya, xb, yb)
    za, zb, zc = np.float32(z[a]), np.float32(z[b] - z[a]), np.float32(z[c] - z[a])
    red, green, blue = colours[a]
    red_b, green_b, blue_b = colours[b, 0] - red, colours[b, 1] - green, colours[b, 2] - blue
    red_c, green_c, blue_c = colours[c, 0] - red, colours[c, 1] - green, colours[c, 2] - blue
    for row in range(y0, y1):
        py = row + 0.5
        for column in range(x0, x1):
            px = column + 0.5
            of_a = (xc - xb) * (py - yb) - (yc - yb) * (px - xb)
            of_b = (xa - xc) * (py - yc) - (ya - yc) * (px - xc)
            of_c = (xb - xa) * (py - ya) - (yb - ya) * (px - xa)
            if of_a >= bias_a and of_b >= bias_b and of_c >= bias_c:
                share_b, share_c = np.float32(of_b * inverse), np.float32(of_c * inverse)
                away = za + (share_b * zb + share_c * zc)
                if away < depth[row - top, column - left]:
                    depth[row - top, column - left] = away
                    sample = colour[row - top, column - left]
                    sample[0] = red + (share_b * red_b + share_c * red_c)
                    sample[1] = green + (share_b * green_b + share_c * green_c)
                    sample[2] = blue + (share_b * blue_b + share_c * blue_c)


@compiled
def _bias(xa: float, ya: float, xb: float, yb: float) -> float:
    """Return the least edge function of samples inside: samples on an edge belong to the triangle on one side of it."""
    owned = ya > yb or (ya == yb and xa < xb)
    return 0.0 if owned else 1e-6


@compiled
def _resolve(
    depth: Colours, colour: Colours, background: Colours, tone: NDArray[np.uint8], picture: NDArray[np.uint8],
    left: int, right: int, first: int, last: int,
) -> None:  # fmt: skip
    most = np.float32(len(tone) - 1)
    quarter, zero = np.float32(0.25), np.float32(0)
    for row in range(first, last):
        for column in range(left, right):
            i, j = 2 * (row - first), 2 * (column - left)
            for k in range(3):
                behind = background[row, column, k]
                total = zero
                for di in range(2):
                    for dj in range(2):
                        empty = depth[i + di, j + dj] == FAR
                        total += behind if empty else colour[i + di, j + dj, k]
                level = min(max(quarter * total, zero), np.float32(1)) * most
                picture[row, column, k] = tone[int(level)]
