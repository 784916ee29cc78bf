"""Twins of ``lipmotion_faces.kernels``: triangles, light, bands of paint and pictures, for all samples at once."""

import math

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.kernels.raster import GRID

Real = NDArray[np.float64]
Colours = NDArray[np.float32]
Samples = tuple[int, int, int, int]


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


def _triangle(corner: Real, z: Real, colour: Colours, samples: Samples, depth: Colours, light: Colours) -> None:
    if (covered := _cover(corner, samples)) is None:
        return
    window, inside, of_b, of_c = covered
    share_b, share_c = of_b.astype(np.float32), of_c.astype(np.float32)
    away = np.float32(z[0]) + (share_b * np.float32(z[1] - z[0]) + share_c * np.float32(z[2] - z[0]))
    seen = inside & (away < depth[window])
    depth[window][seen] = away[seen]
    shares = share_b[seen, None] * (colour[1] - colour[0]) + share_c[seen, None] * (colour[2] - colour[0])
    light[window][seen] = colour[0] + shares


def _cover(corner: Real, samples: Samples) -> tuple[tuple[slice, slice], NDArray[np.bool_], Real, Real] | None:
    """Return the samples around a triangle, which it covers, and its second and third weight; None: nothing is seen."""
    (xa, ya), (xb, yb), (xc, yc) = corner.tolist()
    twice_area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)
    x0, x1 = max(samples[0], int(np.floor(corner[:, 0].min()))), min(samples[2], int(np.ceil(corner[:, 0].max())))
    y0, y1 = max(samples[1], int(np.floor(corner[:, 1].min()))), min(samples[3], int(np.ceil(corner[:, 1].max())))
    if twice_area <= 0 or x0 >= x1 or y0 >= y1:
        return None
    px, py = np.arange(x0, x1)[None] + 0.5, np.arange(y0, y1)[:, None] + 0.5
    of_a = (xc - xb) * (py - yb) - (yc - yb) * (px - xb)
    of_b = (xa - xc) * (py - yc) - (ya - yc) * (px - xc)
    of_c = (xb - xa) * (py - ya) - (yb - ya) * (px - xa)
    inside = (of_a >= bias(xb, yb, xc, yc)) & (of_b >= bias(xc, yc, xa, ya)) & (of_c >= bias(xa, ya, xb, yb))
    window = slice(y0 - samples[1], y1 - samples[1]), slice(x0 - samples[0], x1 - samples[0])
    inverse = 1.0 / twice_area
    return window, inside, of_b * inverse, of_c * inverse


def bias(xa: float, ya: float, xb: float, yb: float) -> float:
    """Return the least edge function of samples inside: samples on an edge belong to the triangle on one side of it."""
    return 0.0 if ya > yb or (ya == yb and xa < xb) else 1e-6


A = -0.5  # parameter of cubic convolution (Keys 1981)


def kernel(distance: float, kind: str) -> float:
    """Return the weight of a pixel at a distance along one side."""
    distance = abs(distance)
    if kind == "linear":
        return max(0.0, 1 - distance)
    if distance <= 1:
        return (A + 2) * distance**3 - (A + 3) * distance**2 + 1
    if distance < 2:
        return A * distance**3 - 5 * A * distance**2 + 8 * A * distance - 4 * A
    return 0.0


def value(picture: np.ndarray, x: float, y: float, kind: str) -> np.ndarray:
    """Return the colours at a position; outside the picture its outermost pixels repeat."""
    height, width = picture.shape[:2]
    total = np.zeros(picture.shape[2:])
    for row in range(math.floor(y) - 2, math.floor(y) + 4):
        for column in range(math.floor(x) - 2, math.floor(x) + 4):
            pixel = picture[min(max(row, 0), height - 1), min(max(column, 0), width - 1)]
            total = total + kernel(x - column, kind) * kernel(y - row, kind) * pixel.astype(float)
    return total


def resample(picture: np.ndarray, to_source: np.ndarray, size: tuple[int, int], kind: str) -> np.ndarray:
    """Return the new picture [shape=(h, w, C)]."""
    new = np.empty((*size, picture.shape[2]))
    for row in range(size[0]):
        for column in range(size[1]):
            x, y = to_source @ [column, row, 1]
            new[row, column] = value(picture, x, y, kind)
    return new


def blended(part: np.ndarray, patch: np.ndarray, weight: np.ndarray, to_patch: np.ndarray, kind: str) -> np.ndarray:
    """Return a part of a frame with the patch blended in, before rounding."""
    new = resample(patch, to_patch, part.shape[:2], kind)
    share = resample(weight[..., None], to_patch, part.shape[:2], "linear")
    return np.clip(part + share * (new - part), 0, 255)
