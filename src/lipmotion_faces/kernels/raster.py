"""Triangles to pixels: a depth buffer with four samples a pixel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiler import compiled

Real = NDArray[np.float64]
Colours = NDArray[np.float32]
FAR = np.float32(np.inf)
BAND = 16  # rows of pixels that are drawn at once: their samples fit the processor's cache
GRID = 256.0  # corners are rounded to this part of a sample, so that neighbouring triangles leave no gap between them


@compiled
def draw(
    points: Real, colours: Colours, triangles: NDArray[np.int32], area: tuple[int, int, int, int],
    background: Colours, tone: NDArray[np.uint8], picture: NDArray[np.uint8],
) -> None:  # fmt: skip
    """Draw triangles over the background into an area of a picture, in place.

    points     : column and row in pixels, and depth (smaller is nearer) of every vertex [shape=(V, 3)]
    colours    : of every vertex, light as a physicist measures it, 0 to 1 [shape=(V, 3)]
    triangles  : counterclockwise on the screen where they face the viewer; others are not drawn [shape=(F, 3)]
    area       : first column and row, and the column and row behind the last ones
    background : light in every pixel [shape=(H, W, 3)]
    tone       : the grey level of light from 0 to 1, in even steps [shape=(L,)]
    picture    : is changed in the area alone [shape=(H, W, 3)]
    """
    x, y, z = np.rint(2 * GRID * points[:, 0]) / GRID, np.rint(2 * GRID * points[:, 1]) / GRID, points[:, 2].copy()
    left, top, right, bottom = area
    bands = (bottom - top + BAND - 1) // BAND
    faces, starts = sort_by_band(x, y, triangles, 2 * left, 2 * right, 2 * top, bands)
    width = right - left
    depth = np.empty((2 * BAND, 2 * width), np.float32)
    colour = np.empty((2 * BAND, 2 * width, 3), np.float32)
    for band in range(bands):
        first = top + band * BAND
        last = min(first + BAND, bottom)
        depth[:] = FAR
        for n in range(starts[band], starts[band + 1]):
            a, b, c = triangles[faces[n]]
            _draw_triangle(x, y, z, colours, a, b, c, 2 * left, 2 * right, 2 * first, 2 * last, depth, colour)
        _resolve(depth, colour, background, tone, picture, left, right, first, last)


@compiled
def sort_by_band(
    x: Real, y: Real, triangles: NDArray[np.int32], left: int, right: int, top: int, bands: int
) -> tuple[NDArray[np.int32], NDArray[np.intp]]:
    """Return the triangles that face the viewer, band after band, and where the triangles of each band begin."""
    spans = np.empty((len(triangles), 2), np.int32)
    starts = np.zeros(bands + 1, np.intp)
    for f in range(len(triangles)):
        a, b, c = triangles[f]
        spans[f, 0], spans[f, 1] = 1, 0
        faces_viewer = (x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a]) < 0
        if faces_viewer and min(x[a], x[b], x[c]) < right and max(x[a], x[b], x[c]) > left:
            low, high = min(y[a], y[b], y[c]), max(y[a], y[b], y[c])
            spans[f, 0] = max(int(np.floor((low - top) / (2 * BAND))), 0)
            spans[f, 1] = min(int(np.floor((high - top) / (2 * BAND))), bands - 1)
            for band in range(spans[f, 0], spans[f, 1] + 1):
                starts[band + 1] += 1
    for band in range(bands):
        starts[band + 1] += starts[band]
    faces = np.empty(starts[bands], np.int32)
    filled = starts.copy()
    for f in range(len(triangles)):
        for band in range(spans[f, 0], spans[f, 1] + 1):
            faces[filled[band]] = f
            filled[band] += 1
    return faces, starts


@compiled
def _draw_triangle(
    x: Real, y: Real, z: Real, colours: Colours, a: int, b: int, c: int, left: int, right: int, top: int, bottom: int,
    depth: Colours, colour: Colours,
) -> None:  # fmt: skip
    # The corners are in whole 1/256 of a sample, so that the edge functions are exact.
    xa, ya, xb, yb, xc, yc = x[a], y[a], x[c], y[c], x[b], y[b]  # clockwise on the screen, whose rows go down
    b, c = c, b
    x0, x1 = max(left, int(np.ceil(min(xa, xb, xc) - 0.5))), min(right, int(np.floor(max(xa, xb, xc) + 0.5)))
    y0, y1 = max(top, int(np.ceil(min(ya, yb, yc) - 0.5))), min(bottom, int(np.floor(max(ya, yb, yc) + 0.5)))
    if x0 >= x1 or y0 >= y1:
        return  # between the middles of samples
    inverse = 1.0 / ((xb - xa) * (yc - ya) - (xc - xa) * (yb - ya))
    bias_a, bias_b, bias_c = compute_bias(xb, yb, xc, yc), compute_bias(xc, yc, xa, ya), compute_bias(xa, ya, xb, yb)
    za, zb, zc = np.float32(z[a]), np.float32(z[b] - z[a]), np.float32(z[c] - z[a])
    red, green, blue = colours[a]
    red_b, green_b, blue_b = colours[b, 0] - red, colours[b, 1] - green, colours[b, 2] - blue
    red_c, green_c, blue_c = colours[c, 0] - red, colours[c, 1] - green, colours[c, 2] - blue
    step_a, step_b, step_c = yc - yb, ya - yc, yb - ya
    per_a, per_b, per_c = 1.0 / (step_a or 1.0), 1.0 / (step_b or 1.0), 1.0 / (step_c or 1.0)
    for row in range(y0, y1):
        px, py = x0 + 0.5, row + 0.5
        of_a = (xc - xb) * (py - yb) - step_a * (px - xb)
        of_b = (xa - xc) * (py - yc) - step_b * (px - xc)
        of_c = (xb - xa) * (py - ya) - step_c * (px - xa)
        enter, leave = narrow(0, x1 - x0, of_a - bias_a, step_a, per_a)
        enter, leave = narrow(enter, leave, of_b - bias_b, step_b, per_b)
        enter, leave = narrow(enter, leave, of_c - bias_c, step_c, per_c)
        of_b, of_c, i = of_b - enter * step_b, of_c - enter * step_c, row - top  # exact, as the corners are
        for j in range(x0 - left + enter, x0 - left + leave):
            share_b, share_c = np.float32(of_b * inverse), np.float32(of_c * inverse)
            away = za + (share_b * zb + share_c * zc)
            if away < depth[i, j]:
                depth[i, j] = away
                colour[i, j, 0] = red + (share_b * red_b + share_c * red_c)
                colour[i, j, 1] = green + (share_b * green_b + share_c * green_c)
                colour[i, j, 2] = blue + (share_b * blue_b + share_c * blue_c)
            of_b -= step_b
            of_c -= step_c


@compiled
def compute_bias(xa: float, ya: float, xb: float, yb: float) -> float:
    """Return the least edge function of samples inside: samples on an edge belong to the triangle on one side of it.

    Edge functions are whole multiples of 1 / GRID², half of which is away from all of them.
    """
    owned = ya > yb or (ya == yb and xa < xb)
    return -0.5 / GRID**2 if owned else 0.5 / GRID**2


@compiled
def narrow(enter: int, leave: int, inside: float, step: float, per_step: float) -> tuple[int, int]:
    """Return the first of a row's samples on the inner side of an edge, and the one behind the last."""
    if step > 0.0:
        leave = min(leave, int(np.floor(inside * per_step)) + 1)
    elif step < 0.0:
        enter = max(enter, int(np.ceil(inside * per_step)))
    elif inside < 0.0:
        leave = 0
    return enter, leave


@compiled
def _resolve(
    depth: Colours, colour: Colours, background: Colours, tone: NDArray[np.uint8], picture: NDArray[np.uint8],
    left: int, right: int, first: int, last: int,
) -> None:  # fmt: skip
    top_level, quarter = np.float32(len(tone) - 1), np.float32(0.25)
    zero, one = np.float32(0), np.float32(1)
    for row in range(first, last):
        i = 2 * (row - first)
        for column in range(left, right):
            j = 2 * (column - left)
            empty_a, empty_b = depth[i, j] == FAR, depth[i, j + 1] == FAR
            empty_c, empty_d = depth[i + 1, j] == FAR, depth[i + 1, j + 1] == FAR
            for k in range(3):
                behind = background[row, column, k]
                total = behind if empty_a else colour[i, j, k]
                total += behind if empty_b else colour[i, j + 1, k]
                total += behind if empty_c else colour[i + 1, j, k]
                total += behind if empty_d else colour[i + 1, j + 1, k]
                level = min(max(quarter * total, zero), one) * top_level
                picture[row, column, k] = tone[int(level)]
