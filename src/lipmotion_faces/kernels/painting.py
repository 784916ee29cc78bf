"""Painting of pictures: textured bands with exact edges, smooth warps, and one layer over another.

Pixels of layers are float32 [shape=(H, W, 4)]: colour 0..255, premultiplied by the cover 0..1 that comes last.
Positions are in pixels; the centre of the first pixel is at 0.5.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiler import compiled

Layer = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Canvas = NDArray[np.uint16]  # values 0..255 in 16 bits, so that pixels can be mixed as whole numbers
Floats = NDArray[np.float64]
Packed = NDArray[np.uint64]
ONE = 1 << 16  # a pixel, in whole numbers


def find_source_places(shift: Floats, step: int, shape: tuple[int, ...], axis: int, length: int) -> Floats:
    """Return where each pixel of a target of a shape lies along an axis of its source, which is so long."""
    row, column = np.arange(shape[0]) / step, np.arange(shape[1]) / step
    r, c = np.minimum(row.astype(int), len(shift) - 2), column.astype(int)
    rows = shift[r] + (row - r)[:, None] * (shift[r + 1] - shift[r])
    shifts = rows[:, c] + (column - c) * (rows[:, c + 1] - rows[:, c])
    return np.clip(np.indices(shape[:2])[axis] + shifts, 0, length - 1)


def warp_arrays(source: Layer, shift_x: Floats, shift_y: Floats, step: int, target: Layer) -> None:
    """Fill a picture as ``warp``, all pixels at once."""
    y, x = (find_source_places(s, step, target.shape, k, source.shape[k]) for k, s in enumerate((shift_y, shift_x)))
    y0, x0 = np.minimum(y.astype(int), source.shape[0] - 2), np.minimum(x.astype(int), source.shape[1] - 2)
    fx, fy = (x - x0).astype(np.float32)[..., None], (y - y0).astype(np.float32)[..., None]
    above = source[y0, x0] + fx * (source[y0, x0 + 1] - source[y0, x0])
    below = source[y0 + 1, x0] + fx * (source[y0 + 1, x0 + 1] - source[y0 + 1, x0])
    target[...] = above + fy * (below - above)


def warp_packed_arrays(source: Packed, shift_x: Floats, shift_y: Floats, step: int, target: Bytes) -> None:
    """Fill a picture as ``_warp_packed``, all pixels at once; levels differ by what that rounds."""
    levels = np.empty((*target.shape[:2], 4), np.float32)
    warp_arrays(source[..., None].view(np.uint16).astype(np.float32), shift_x, shift_y, step, levels)
    target[...] = levels[..., : target.shape[2]] + 0.5


def stack_arrays(below: Layer, shade: Layer, skin: Layer, above: Layer, target: Canvas) -> None:
    """Fill a picture as ``stack``, all pixels at once."""
    mixed = below + skin[..., 4:].astype(np.float64) * shade
    mixed = skin[..., :4] + (1 - skin[..., 3:4].astype(np.float64)) * mixed
    target[...] = (above + (1 - above[..., 3:].astype(np.float64)) * mixed) * [1, 1, 1, 255] + 0.5


@compiled
def paint_band(layer: Layer, top: Floats, bottom: Floats, across: Floats, texture: Floats) -> None:
    """Paint a texture from ``top`` down to ``bottom`` on a layer, in place; nothing where they meet.

    top, bottom : heights at C evenly spaced places in each column of pixels [shape=(C, W)]; cover is exact along each
    across      : 0 to 1, where each column lies in the texture [shape=(W,)]
    texture     : colour 0..255 and opacity 0..1 [shape=(D, U, 4)]; the first row lies at the top of the band, the last
                  one at its bottom; values between are interpolated
    """
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
        along = across[column] * (wide - 1)
        u0 = min(int(along), max(wide - 2, 0))
        u1 = min(u0 + 1, wide - 1)
        fu = along - u0
        for row in range(max(0, int(np.floor(highest))), min(len(layer), int(np.ceil(lowest)))):
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


@partial(compiled, form=warp_arrays)
def warp(source: Layer, shift_x: Floats, shift_y: Floats, step: int, target: Layer) -> None:
    """Fill a picture with another one that is shifted, by a different distance everywhere.

    source, target   : pixels [shape=(H, W, C)]; beyond its edges the source goes on with its last pixels
    shift_x, shift_y : how far the source is from each target pixel, at every ``step``-th pixel from the first one on
                       [shape=(ceil(H / step) + 1, ceil(W / step) + 1)]; interpolated between them
    """
    height, width, channels = target.shape
    last_x, last_y = source.shape[1] - 1.0, source.shape[0] - 1.0
    row_x, row_y = np.empty(shift_x.shape[1]), np.empty(shift_x.shape[1])
    for row in range(height):
        fill_grid_row(shift_x, shift_y, row / step, row_x, row_y)
        for cell in range((width + step - 1) // step):
            cell_x, more_x = row_x[cell], row_x[cell + 1] - row_x[cell]
            cell_y, more_y = row_y[cell], row_y[cell + 1] - row_y[cell]
            for column in range(cell * step, min(cell * step + step, width)):
                share = column / step - cell
                x = min(max(column + (cell_x + share * more_x), 0.0), last_x)
                y = min(max(row + (cell_y + share * more_y), 0.0), last_y)
                x0, y0 = min(np.uint64(x), np.uint64(last_x - 1)), min(np.uint64(y), np.uint64(last_y - 1))
                x1, y1 = x0 + np.uint64(1), y0 + np.uint64(1)
                fx, fy = np.float32(x - x0), np.float32(y - y0)
                for channel in range(channels):
                    left, right = source[y0, x0, channel], source[y0, x1, channel]
                    above = left + fx * (right - left)
                    left, right = source[y1, x0, channel], source[y1, x1, channel]
                    target[row, column, channel] = above + fy * (left + fx * (right - left) - above)


def warp_bytes(source: Canvas, shift_x: Floats, shift_y: Floats, step: int, target: Bytes) -> None:
    """Fill a picture of bytes as ``warp`` does; shifts are rounded down to 1/65536, shares of pixels to 1/256.

    source : values 0..255 [shape=(H, W, 4)], the last two axes contiguous
    target : [shape=(H, W, C)], of the first C channels, 3 or 4
    """
    _warp_packed(source.view(np.uint64)[..., 0], shift_x, shift_y, step, target)


@partial(compiled, form=stack_arrays)
def stack(below: Layer, shade: Layer, skin: Layer, above: Layer, target: Canvas) -> None:
    """Fill in the values 0..255 of four layers over one another [shape=(H, W, 4)], premultiplied.

    below : what is behind
    shade : is added to it where the shadow falls
    skin  : a layer with the strength of its shadow on what is behind it, 0..1, in one more channel [shape=(H, W, 5)]
    above : a layer over the skin
    """
    for row in range(target.shape[0]):
        for column in range(target.shape[1]):
            shadow = np.float64(skin[row, column, 4])
            behind_skin, behind_above = 1 - np.float64(skin[row, column, 3]), 1 - np.float64(above[row, column, 3])
            for channel in range(4):
                mixed = below[row, column, channel] + shadow * shade[row, column, channel]
                mixed = skin[row, column, channel] + behind_skin * mixed
                mixed = above[row, column, channel] + behind_above * mixed
                target[row, column, channel] = np.uint16(mixed * (255.0 if channel == 3 else 1.0) + 0.5)


@partial(compiled, form=warp_packed_arrays)
def _warp_packed(source: Packed, shift_x: Floats, shift_y: Floats, step: int, target: Bytes) -> None:
    """Mix all four channels of ``warp_bytes`` at once, in the parts of a number; no sum needs more than 16 bits."""
    height, width, channels = target.shape
    end_x, end_y = (source.shape[1] - 1 << 16) - 1, (source.shape[0] - 1 << 16) - 1
    row_x, row_y = np.empty(shift_x.shape[1]), np.empty(shift_x.shape[1])
    one, two, half = np.uint64(1), np.uint64(8), np.uint64(0x0080008000800080)
    share, byte = np.uint64(256), np.uint64(255)
    for row in range(height):
        fill_grid_row(shift_x, shift_y, row / step, row_x, row_y)
        for cell in range((width + step - 1) // step):
            x, more_x = int(np.floor(row_x[cell] * ONE)), int(np.floor((row_x[cell + 1] - row_x[cell]) * ONE / step))
            y, more_y = int(np.floor(row_y[cell] * ONE)), int(np.floor((row_y[cell + 1] - row_y[cell]) * ONE / step))
            x, y = x + (cell * step << 16), y + (row << 16)
            for column in range(cell * step, min(cell * step + step, width)):
                at_x, at_y = np.uint64(min(max(x, 0), end_x)), np.uint64(min(max(y, 0), end_y))
                x, y = x + more_x + ONE, y + more_y
                x0, y0 = at_x >> np.uint64(16), at_y >> np.uint64(16)
                fx, fy = at_x >> two & byte, at_y >> two & byte
                both = fx * fy >> two
                mixed = source[y0, x0] * (share - fx - fy + both) + source[y0, x0 + one] * (fx - both)
                mixed += source[y0 + one, x0] * (fy - both) + source[y0 + one, x0 + one] * both + half
                target[row, column, 0] = np.uint8(mixed >> np.uint64(8) & byte)
                target[row, column, 1] = np.uint8(mixed >> np.uint64(24) & byte)
                target[row, column, 2] = np.uint8(mixed >> np.uint64(40) & byte)
                if channels == 4:
                    target[row, column, 3] = np.uint8(mixed >> np.uint64(56))


@compiled
def fill_grid_row(shift_x: Floats, shift_y: Floats, down: float, row_x: Floats, row_y: Floats) -> None:
    """Fill in the values of two grids in one row of pixels."""
    r = min(int(down), shift_x.shape[0] - 2)
    share = down - r
    for column in range(shift_x.shape[1]):
        row_x[column] = shift_x[r, column] + share * (shift_x[r + 1, column] - shift_x[r, column])
        row_y[column] = shift_y[r, column] + share * (shift_y[r + 1, column] - shift_y[r, column])
