"""Painting of pictures, all pixels at once: the definition of ``lipmotion_faces.kernels.painting``, to the bit."""

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.kernels.painting import Bytes, Canvas, Floats, Layer


def paint_band(layer: Layer, top: Floats, bottom: Floats, across: Floats, texture: Floats) -> None:
    row = np.arange(len(layer))[:, None].astype(np.float64)
    cover = np.zeros(layer.shape[:2])
    for upper, lower in zip(top, bottom, strict=True):
        cover += np.maximum(np.minimum(lower, row + 1) - np.maximum(upper, row), 0)
    cover = cover / len(top)
    start, end = top[0].copy(), bottom[0].copy()
    for upper, lower in zip(top[1:], bottom[1:], strict=True):
        start += upper
        end += lower
    start, end = start / len(top), end / len(top)
    depth = np.minimum(np.maximum((row + 0.5 - start) / np.maximum(end - start, 1e-3), 0), 1)
    down, beside = depth * (texture.shape[0] - 1), across * (texture.shape[1] - 1)
    d0 = np.minimum(down.astype(np.int64), max(texture.shape[0] - 2, 0))
    u0 = np.minimum(beside.astype(np.int64), max(texture.shape[1] - 2, 0))
    d1, u1 = np.minimum(d0 + 1, texture.shape[0] - 1), np.minimum(u0 + 1, texture.shape[1] - 1)
    fd, fu = (down - d0)[..., None], (beside - u0)[:, None]
    upper_row = texture[d0, u0] + fu * (texture[d0, u1] - texture[d0, u0])
    lower_row = texture[d1, u0] + fu * (texture[d1, u1] - texture[d1, u0])
    texel = upper_row + fd * (lower_row - upper_row)
    opacity = cover * texel[..., 3]
    texel[..., 3] = 1
    layer += (opacity[..., None] * (texel - layer)).astype(np.float32)


def warp(source: Layer, shift_x: Floats, shift_y: Floats, step: int, target: Layer) -> None:
    y0, x0, y, x = _sources(source.shape, shift_x, shift_y, step, target.shape)
    fx, fy = (x - x0).astype(np.float32)[..., None], (y - y0).astype(np.float32)[..., None]
    above = source[y0, x0] + fx * (source[y0, x0 + 1] - source[y0, x0])
    below = source[y0 + 1, x0] + fx * (source[y0 + 1, x0 + 1] - source[y0 + 1, x0])
    target[...] = above + fy * (below - above)


def warp_bytes(source: Canvas, shift_x: Floats, shift_y: Floats, step: int, target: Bytes) -> None:
    height, width = target.shape[:2]
    x = _whole_shifts(shift_x, step, height, width) + (np.arange(width) << 16)
    y = _whole_shifts(shift_y, step, height, width) + (np.arange(height)[:, None] << 16)
    x, y = (np.clip(at, 0, ((size - 1) << 16) - 1) for at, size in ((x, source.shape[1]), (y, source.shape[0])))
    x0, y0, fx, fy = x >> 16, y >> 16, (x >> 8 & 255)[..., None], (y >> 8 & 255)[..., None]
    both = fx * fy >> 8
    pixels = source[..., : target.shape[2]].astype(np.int32)
    mixed = pixels[y0, x0] * (256 - fx - fy + both) + pixels[y0, x0 + 1] * (fx - both)
    mixed += pixels[y0 + 1, x0] * (fy - both) + pixels[y0 + 1, x0 + 1] * both + 128
    target[...] = mixed >> 8


def stack(below: Layer, shade: Layer, skin: Layer, above: Layer, target: Canvas) -> None:
    skins = skin.astype(np.float64)
    mixed = below + skins[..., 4:] * shade
    mixed = skins[..., :4] + (1 - skins[..., 3:4]) * mixed
    mixed = above + (1 - above[..., 3:4].astype(np.float64)) * mixed
    target[...] = (mixed * np.array([1, 1, 1, 255], np.float64) + 0.5).astype(np.uint16)


def _sources(
    source: tuple[int, ...], shift_x: Floats, shift_y: Floats, step: int, target: tuple[int, ...]
) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats, Floats]:
    """Return the source pixels before each target pixel's, rows and columns, and the exact places."""
    height, width = target[:2]
    x = np.arange(width) + _between(shift_x, step, height, width)
    y = np.arange(height)[:, None] + _between(shift_y, step, height, width)
    x, y = np.minimum(np.maximum(x, 0), source[1] - 1), np.minimum(np.maximum(y, 0), source[0] - 1)
    return np.minimum(y.astype(np.int64), source[0] - 2), np.minimum(x.astype(np.int64), source[1] - 2), y, x


def _whole_shifts(grid: Floats, step: int, height: int, width: int) -> NDArray[np.int64]:
    """Return a grid's values at every pixel in 1/65536 [shape=(height, width)], rounded as in the compiled form."""
    row = np.arange(height) / step
    r = np.minimum(row.astype(int), len(grid) - 2)
    rows = grid[r] + (row - r)[:, None] * (grid[r + 1] - grid[r])
    start = np.floor(rows[:, :-1] * 65536).astype(np.int64)
    more = np.floor((rows[:, 1:] - rows[:, :-1]) * 65536 / step).astype(np.int64)
    column = np.arange(width)
    return start[:, column // step] + column % step * more[:, column // step]


def _between(grid: Floats, step: int, height: int, width: int) -> Floats:
    """Return the values of a grid at every pixel [shape=(height, width)]."""
    row, column = np.arange(height) / step, np.arange(width) / step
    r, c = np.minimum(row.astype(int), len(grid) - 2), np.minimum(column.astype(int), grid.shape[1] - 2)
    fr, fc = (row - r)[:, None], column - c
    first = grid[r][:, c] + fr * (grid[r + 1][:, c] - grid[r][:, c])
    second = grid[r][:, c + 1] + fr * (grid[r + 1][:, c + 1] - grid[r][:, c + 1])
    return np.asarray(first + fc * (second - first))
