"""Triangles to pixels by definition: a triangle at a time, all of its samples at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.kernels.raster import GRID

Real = NDArray[np.float64]
Colours = NDArray[np.float32]


def draw(
    points: Real,
    colours: Colours,
    triangles: NDArray[np.int32],
    area: tuple[int, int, int, int],
    background: Colours,
    tone: NDArray[np.uint8],
    picture: NDArray[np.uint8],
) -> None:
    """Draw as ``lipmotion_faces.kernels.raster.draw`` says."""
    corners, z = np.rint(2 * GRID * points[:, :2]) / GRID, points[:, 2]
    left, top, right, bottom = area
    light = np.repeat(np.repeat(background[top:bottom, left:right], 2, axis=0), 2, axis=1)
    depth = np.full(light.shape[:2], np.inf, np.float32)
    samples = (2 * left, 2 * top, 2 * right, 2 * bottom)
    for a, c, b in triangles.tolist():  # clockwise on the screen, whose rows go down
        _triangle(corners[[a, b, c]], z[[a, b, c]], colours[[a, b, c]], samples, depth, light)
    total = np.zeros((bottom - top, right - left, 3), np.float32)
    for row in range(2):
        for column in range(2):
            total += light[row::2, column::2]
    level = np.clip(np.float32(0.25) * total, 0, 1) * np.float32(len(tone) - 1)
    picture[top:bottom, left:right] = tone[level.astype(int)]


def _triangle(
    corner: Real, z: Real, colour: Colours, samples: tuple[int, int, int, int], depth: Colours, light: Colours
) -> None:
    (xa, ya), (xb, yb), (xc, yc) = corner.tolist()
    twice_area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)
    x0, x1 = max(samples[0], int(np.floor(corner[:, 0].min()))), min(samples[2], int(np.ceil(corner[:, 0].max())))
    y0, y1 = max(samples[1], int(np.floor(corner[:, 1].min()))), min(samples[3], int(np.ceil(corner[:, 1].max())))
    if twice_area <= 0 or x0 >= x1 or y0 >= y1:
        return
    px, py = np.arange(x0, x1)[None] + 0.5, np.arange(y0, y1)[:, None] + 0.5
    of_a = (xc - xb) * (py - yb) - (yc - yb) * (px - xb)
    of_b = (xa - xc) * (py - yc) - (ya - yc) * (px - xc)
    of_c = (xb - xa) * (py - ya) - (yb - ya) * (px - xa)
    inside = (of_a >= bias(xb, yb, xc, yc)) & (of_b >= bias(xc, yc, xa, ya)) & (of_c >= bias(xa, ya, xb, yb))
    inverse = 1.0 / twice_area
    share_b, share_c = (of_b * inverse).astype(np.float32), (of_c * inverse).astype(np.float32)
    away = np.float32(z[0]) + (share_b * np.float32(z[1] - z[0]) + share_c * np.float32(z[2] - z[0]))
    window = slice(y0 - samples[1], y1 - samples[1]), slice(x0 - samples[0], x1 - samples[0])
    seen = inside & (away < depth[window])
    depth[window][seen] = away[seen]
    shares = share_b[seen, None] * (colour[1] - colour[0]) + share_c[seen, None] * (colour[2] - colour[0])
    light[window][seen] = colour[0] + shares


def bias(xa: float, ya: float, xb: float, yb: float) -> float:
    """Return the least edge function of samples inside: samples on an edge belong to the triangle on one side of it."""
    return 0.0 if ya > yb or (ya == yb and xa < xb) else 1e-6
