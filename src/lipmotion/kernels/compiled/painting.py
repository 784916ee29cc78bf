"""Painting of pictures, compiled: the same operations in the same order as in ``kernels.painting``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiled.compiler import compiled

Layer = NDArray[np.float32]
Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]


@compiled
def paint_band(
    layer: Layer, first: int, last: int, top: Floats, bottom: Floats, across: Floats, texture: Floats
) -> None:
    """Paint a texture between two heights on rows of a layer, as ``kernels.painting.paint_band``."""
    places, columns = top.shape
    deep, wide = texture.shape[0], texture.shape[1]
    for column in range(columns):
        start, end = top[0, column], bottom[0, column]
        highest, lowest = start, end
        for place in range(1, places):
            start += top[place, column]
            end += bottom[place, column]
            highest, lowest = min(highest, top[place, column]), max(lowest, bottom[place, column])
        start, end = start / places, end / places
        length = max(end - start, 1e-3)
        beside = across[column] * (wide - 1)
        u0 = min(int(beside), max(wide - 2, 0))
        u1 = min(u0 + 1, wide - 1)
        fu = beside - u0
        for row in range(max(first, int(np.floor(highest))), min(last, int(np.ceil(lowest)))):
            cover = 0.0
            for place in range(places):
                upper, lower = max(top[place, column], float(row)), min(bottom[place, column], row + 1.0)
                cover += max(lower - upper, 0.0)
            cover = cover / places
            if cover > 0:
                depth = min(max((row + 0.5 - start) / length, 0.0), 1.0)
                down = depth * (deep - 1)
                d0 = min(int(down), max(deep - 2, 0))
                d1 = min(d0 + 1, deep - 1)
                fd = down - d0
                above = texture[d0, u0, 3] + fu * (texture[d0, u1, 3] - texture[d0, u0, 3])
                below = texture[d1, u0, 3] + fu * (texture[d1, u1, 3] - texture[d1, u0, 3])
                opacity = cover * (above + fd * (below - above))
                for channel in range(3):
                    above = texture[d0, u0, channel] + fu * (texture[d0, u1, channel] - texture[d0, u0, channel])
                    below = texture[d1, u0, channel] + fu * (texture[d1, u1, channel] - texture[d1, u0, channel])
                    texel = above + fd * (below - above)
                    layer[row, column, channel] += np.float32(opacity * (texel - layer[row, column, channel]))
                layer[row, column, 3] += np.float32(opacity * (1.0 - layer[row, column, 3]))


@compiled
def warp_floats(source: Layer, shift_x: Floats, shift_y: Floats, step: int, target: Layer) -> None:
    """Fill a float32 picture with another one that is shifted, as ``kernels.painting.warp``."""
    channels = target.shape[2]
    for row in range(target.shape[0]):
        for column in range(target.shape[1]):
            y0, x0, fy, fx = _place(source.shape, shift_x, shift_y, step, row, column)
            for channel in range(channels):
                left, right = source[y0, x0, channel], source[y0, x0 + 1, channel]
                above = left + fx * (right - left)
                left, right = source[y0 + 1, x0, channel], source[y0 + 1, x0 + 1, channel]
                below = left + fx * (right - left)
                target[row, column, channel] = above + fy * (below - above)


@compiled
def warp_bytes(source: Bytes, shift_x: Floats, shift_y: Floats, step: int, target: Bytes) -> None:
    """Fill a picture of bytes with another one that is shifted, as ``kernels.painting.warp``."""
    channels = target.shape[2]
    for row in range(target.shape[0]):
        for column in range(target.shape[1]):
            y0, x0, fy, fx = _place(source.shape, shift_x, shift_y, step, row, column)
            for channel in range(channels):
                left, right = np.float32(source[y0, x0, channel]), np.float32(source[y0, x0 + 1, channel])
                above = left + fx * (right - left)
                left, right = np.float32(source[y0 + 1, x0, channel]), np.float32(source[y0 + 1, x0 + 1, channel])
                below = left + fx * (right - left)
                target[row, column, channel] = np.uint8(above + fy * (below - above) + np.float32(0.5))


@compiled
def _place(shape: Any, shift_x: Floats, shift_y: Floats, step: int, row: int, column: int) -> Any:
    """Return the pixel of the source before a target pixel, and the share of the next one: rows, then columns."""
    across, down = column / step, row / step
    r, c = min(int(down), shift_x.shape[0] - 2), min(int(across), shift_x.shape[1] - 2)
    fr, fc = down - r, across - c
    first = shift_x[r, c] + fr * (shift_x[r + 1, c] - shift_x[r, c])
    second = shift_x[r, c + 1] + fr * (shift_x[r + 1, c + 1] - shift_x[r, c + 1])
    x = min(max(column + (first + fc * (second - first)), 0.0), shape[1] - 1.0)
    first = shift_y[r, c] + fr * (shift_y[r + 1, c] - shift_y[r, c])
    second = shift_y[r, c + 1] + fr * (shift_y[r + 1, c + 1] - shift_y[r, c + 1])
    y = min(max(row + (first + fc * (second - first)), 0.0), shape[0] - 1.0)
    x0, y0 = min(int(x), shape[1] - 2), min(int(y), shape[0] - 2)
    return y0, x0, np.float32(y - y0), np.float32(x - x0)


@compiled
def stack(below: Layer, shade: Layer, skin: Layer, above: Layer, target: Bytes) -> None:
    """Fill in the bytes of layers over one another, as ``kernels.painting.stack``."""
    for row in range(target.shape[0]):
        for column in range(target.shape[1]):
            shadow = float(skin[row, column, 4])
            behind_skin, behind_above = 1 - float(skin[row, column, 3]), 1 - float(above[row, column, 3])
            for channel in range(4):
                mixed = below[row, column, channel] + shadow * shade[row, column, channel]
                mixed = skin[row, column, channel] + behind_skin * mixed
                mixed = above[row, column, channel] + behind_above * mixed
                target[row, column, channel] = np.uint8(mixed * (255.0 if channel == 3 else 1.0) + 0.5)
