"""Pictures as planes of bytes, as encoders take them: layers that move, laid on them, and the whole, moved.

Planes are uint8 [shape=(3, H, W)]; opaque. A *packed* plane holds, for every pixel, the pixel itself, the one to its
right, the one below and the one below that, from the lowest byte to the highest one [dtype uint32]: so one number is
fetched for each pixel that is moved. Shifts are in pixels, at every ``STEP``-th pixel of a window from its first one on
[shape=(ceil(h / STEP) + 1, ceil(w / STEP) + 1)], and interpolated between; they are rounded down to 1/65536 of a pixel,
shares of pixels to 1/256. Beyond its edges a window goes on with its last pixels.

The work of a row is divided into short loops over neighbouring pixels, of 32-bit numbers alone (hence the conversions),
so that each but the one that fetches pixels from memory becomes vector instructions: five times as fast as one loop.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiler import compiled
from lipmotion_faces.kernels.painting import row_of_grids

Bytes = NDArray[np.uint8]
Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Packed = NDArray[np.uint32]
Whole = NDArray[np.int32]
STEP = 8
"""Pixels between shifts; a constant, so that the loop over a cell is one instruction."""
SEGMENT = 64
"""Pixels of a row of skin that are laid at once; a multiple of ``STEP``."""
BOTH = np.uint32(0x00FF00FF)
EIGHT, SIXTEEN = np.uint32(8), np.uint32(16)
ONE, LOW, HALF = np.uint32(256), np.uint32(0xFFFF), np.uint32(32768)


class Box(NamedTuple):
    """The pixels y0 <= y < y1, x0 <= x < x1 of planes."""

    y0: int
    x0: int
    y1: int
    x1: int

    @property
    def area(self) -> tuple[slice, slice]:
        """The index of these pixels in a plane."""
        return slice(self.y0, self.y1), slice(self.x0, self.x1)


class StillLayers(NamedTuple):
    """Layers that do not move, around skin that does; colours of 0..255, premultiplied by the cover.

    below : what is behind the skin [shape=(3, h, w)]
    shade : is added to it where the shadow of the skin falls [shape=(3, h, w)]
    above : what is in front of the skin, its cover 0..1 last [shape=(4, h, w)]
    """

    below: Singles
    shade: Singles
    above: Singles


class EyeLayers(NamedTuple):
    """The parts of eyes; colours of 0..255, premultiplied by the cover 0..1 that comes last.

    under   : what is behind the irises [shape=(h, w, 4)]
    opening : between the lids, the share of each pixel in which the irises are seen [shape=(h, w)]
    over    : what is in front of the irises [shape=(h, w, 4)]
    iris    : the irises, looking straight ahead [shape=(h, w, 4)]
    """

    under: Singles
    opening: Singles
    over: Singles
    iris: Singles


@compiled
def pack(plane: Bytes, y0: int, x0: int, y1: int, x1: int, mean: bool, packed: Packed) -> None:
    """Fill in a window of a packed plane [shape=(H, W)], or the mean of each pixel and its three neighbours."""
    width, last_x, last_y = x1 - x0, plane.shape[1] - 1, plane.shape[0] - 1
    above, below = np.zeros(width + 1, np.uint32), np.zeros(width + 1, np.uint32)
    inside = min(x1 + 1, last_x if mean else last_x + 1) - x0
    for row in range(y0, y1 + 1):
        here, following = plane[min(row, last_y), x0:], plane[min(row + 1, last_y), x0:]
        for column in range(width + 1):
            above[column] = below[column]
        if mean:
            for column in range(inside):
                four = np.uint32(np.uint32(here[column]) + np.uint32(here[column + 1]))
                four = np.uint32(four + np.uint32(following[column]))
                four = np.uint32(four + np.uint32(following[column + 1]))
                below[column] = np.uint32(four + np.uint32(2)) >> np.uint32(2)
        else:
            for column in range(inside):
                below[column] = np.uint32(here[column])
        for column in range(inside, width + 1):
            below[column] = below[inside - 1]
        if row > y0:
            line = packed[row - 1, x0:x1]
            for column in range(width):
                upper = np.uint32(above[column] | np.uint32(above[column + 1] << EIGHT))
                lower = np.uint32(below[column] | np.uint32(below[column + 1] << EIGHT))
                line[column] = np.uint32(upper | np.uint32(lower << SIXTEEN))


@compiled
def _places(
    row_x: Floats, row_y: Floats, row: int, first: int, count: int, height: int, width: int, stride: int, index: Whole,
    share_x: Packed, share_y: Packed,
) -> None:  # fmt: skip
    """Fill in the sources of some pixels of a row: number of the pixel, and 1/256 of the way to the next ones."""
    end_x, end_y, none = np.int32((width - 1 << 16) - 1), np.int32((height - 1 << 16) - 1), np.int32(0)
    for cell in range((count + STEP - 1) // STEP):
        at, start = first // STEP + cell, STEP * cell
        x = np.int32(int(np.floor(row_x[at] * 65536)) + (at * STEP << 16))
        y = np.int32(int(np.floor(row_y[at] * 65536)) + (row << 16))
        more_x = np.int32(int(np.floor((row_x[at + 1] - row_x[at]) * 65536 / STEP)) + 65536)
        more_y = np.int32(np.floor((row_y[at + 1] - row_y[at]) * 65536 / STEP))
        for column in range(STEP):
            share_x[start + column] = np.uint32(np.int32(x + np.int32(np.int32(column) * more_x)))
            share_y[start + column] = np.uint32(np.int32(y + np.int32(np.int32(column) * more_y)))
    for column in range(count):
        x, y = np.int32(share_x[column]), np.int32(share_y[column])
        x, y = min(max(x, none), end_x), min(max(y, none), end_y)
        rows = np.int32(np.int32(y >> np.int32(16)) * np.int32(stride))
        index[column] = np.int32(rows + np.int32(x >> np.int32(16)))
        share_x[column] = np.uint32(np.uint32(np.uint32(x) >> EIGHT) & np.uint32(255))
        share_y[column] = np.uint32(np.uint32(np.uint32(y) >> EIGHT) & np.uint32(255))


@compiled
def _mixed(four: np.uint32, share_x: np.uint32, share_y: np.uint32) -> np.uint32:
    """Return the mean of four packed pixels by their shares, times 65536."""
    left, right = np.uint32(four & BOTH), np.uint32(np.uint32(four >> EIGHT) & BOTH)
    rows = np.uint32(np.uint32(left * np.uint32(ONE - share_x)) + np.uint32(right * share_x))
    upper = np.uint32(np.uint32(rows & LOW) * np.uint32(ONE - share_y))
    return np.uint32(upper + np.uint32(np.uint32(rows >> SIXTEEN) * share_y))


@compiled
def _fetch(flat: Packed, index: Whole, count: int, found: Packed) -> None:
    for column in range(count):
        found[column] = flat[np.uint32(index[column])]


@compiled
def _write(found: Packed, share_x: Packed, share_y: Packed, count: int, target: Bytes) -> None:
    for column in range(count):
        mixed = np.uint32(_mixed(found[column], share_x[column], share_y[column]))
        target[column] = np.uint8(np.uint32(mixed + HALF) >> SIXTEEN)


@compiled
def warp_planes(
    packed: Packed, y0: int, x0: int, y1: int, x1: int, shift_x: Floats, shift_y: Floats, luma: Bytes, blue: Bytes, red:
    Bytes,
) -> None:  # fmt: skip
    """Fill a window of a picture with another one that is shifted, by a different distance everywhere.

    packed    : planes of brightness and of two colours, the latter of means [shape=(3, H, W)]
    y0 … x1   : the window, of even places and sizes
    luma      : brightness [shape=(H, W)];  blue, red : colours at half the width and height [shape=(H / 2, W / 2)]
    """
    height, width = y1 - y0, x1 - x0
    row_x, row_y = np.empty(shift_x.shape[1]), np.empty(shift_x.shape[1])
    index, found = np.empty(width + STEP, np.int32), np.empty(width, np.uint32)
    share_x, share_y = np.empty(width + STEP, np.uint32), np.empty(width + STEP, np.uint32)
    stride = packed.shape[2]
    flat = packed.reshape(3, packed.shape[1] * stride)
    for row in range(height):
        row_of_grids(shift_x, shift_y, row / STEP, row_x, row_y)
        _places(row_x, row_y, row, 0, width, height, width, stride, index, share_x, share_y)
        _fetch(flat[0, y0 * stride + x0 :], index, width, found)
        _write(found, share_x, share_y, width, luma[y0 + row, x0:x1])
        if row % 2 == 0:
            half = width // 2
            for column in range(half):
                index[column] = index[2 * column]
                share_x[column], share_y[column] = share_x[2 * column], share_y[2 * column]
            _fetch(flat[1, y0 * stride + x0 :], index, half, found)
            _write(found, share_x, share_y, half, blue[(y0 + row) // 2, x0 // 2 : x1 // 2])
            _fetch(flat[2, y0 * stride + x0 :], index, half, found)
            _write(found, share_x, share_y, half, red[(y0 + row) // 2, x0 // 2 : x1 // 2])


@compiled
def lay_skin(
    skin: Packed, shift_x: Floats, shift_y: Floats, below: Singles, shade: Singles, above: Singles, y0: int, x0: int,
    target: Bytes,
) -> None:  # fmt: skip
    """Lay skin that is shifted, by a different distance everywhere, between ``StillLayers`` on a window of planes.

    skin   : packed colours, premultiplied; cover, and strength of the shadow on what is behind, 0..255
             [shape=(5, h, w)]
    target : [shape=(3, H, W)], in which the window begins at y0, x0
    """
    _, height, width = skin.shape
    flat = skin.reshape(5, height * width)
    row_x, row_y = np.empty(shift_x.shape[1]), np.empty(shift_x.shape[1])
    index, found = np.empty(SEGMENT, np.int32), np.empty(SEGMENT, np.uint32)
    share_x, share_y = np.empty(SEGMENT, np.uint32), np.empty(SEGMENT, np.uint32)
    cover, shadow = np.empty(SEGMENT, np.float32), np.empty(SEGMENT, np.float32)
    whole, half, part = np.float32(1), np.float32(0.5), np.float32(1 / 65536)
    share = np.float32(1 / (255 * 65536))
    for row in range(height):
        row_of_grids(shift_x, shift_y, row / STEP, row_x, row_y)
        for first in range(0, width, SEGMENT):
            count = min(SEGMENT, width - first)
            _places(row_x, row_y, row, first, count, height, width, width, index, share_x, share_y)
            _fetch(flat[3], index, count, found)
            opaque, most = np.uint32(0xFFFFFFFF), np.float32(0)
            front = above[3, row, first : first + count]
            for column in range(count):
                opaque = np.uint32(opaque & found[column])
                most = max(most, front[column])
            for column in range(count):
                mixed = np.uint32(_mixed(found[column], share_x[column], share_y[column]))
                cover[column] = np.float32(np.int32(mixed)) * share
            if opaque == np.uint32(0xFFFFFFFF) and most == 0:  # nothing but skin is seen
                for channel in range(3):
                    _fetch(flat[channel], index, count, found)
                    line = target[channel, y0 + row, x0 + first : x0 + first + count]
                    _write(found, share_x, share_y, count, line)
                continue
            _fetch(flat[4], index, count, found)
            for column in range(count):
                mixed = np.uint32(_mixed(found[column], share_x[column], share_y[column]))
                shadow[column] = np.float32(np.int32(mixed)) * share
            for channel in range(3):
                _fetch(flat[channel], index, count, found)
                back, dark = below[channel, row, first : first + count], shade[channel, row, first : first + count]
                hair = above[channel, row, first : first + count]
                line = target[channel, y0 + row, x0 + first : x0 + first + count]
                for column in range(count):
                    mixed = np.uint32(_mixed(found[column], share_x[column], share_y[column]))
                    behind = back[column] + shadow[column] * dark[column]
                    behind = np.float32(np.int32(mixed)) * part + (whole - cover[column]) * behind
                    behind = hair[column] + (whole - front[column]) * behind
                    line[column] = np.uint8(np.int32(behind + half))


@compiled
def lay_eyes(
    under: Singles, opening: Singles, over: Singles, iris: Singles, x: np.float32, y: np.float32, y0: int, x0: int,
    target: Bytes,
) -> None:  # fmt: skip
    """Lay ``EyeLayers`` on a window of planes at y0, x0; x, y: from each pixel to that of the irises seen there."""
    height, width = opening.shape
    last_x, last_y, none, whole = np.float32(width - 1), np.float32(height - 1), np.float32(0), np.float32(1)
    eye = np.empty(4, np.float32)
    for row in range(height):
        at_y = min(max(np.float32(row) + y, none), last_y)
        r = min(int(at_y), height - 2)
        fy = at_y - np.float32(r)
        for column in range(width):
            if over[row, column, 3] == 0 and under[row, column, 3] == 0:
                continue
            for channel in range(4):
                eye[channel] = under[row, column, channel]
            if opening[row, column] > 0:
                at_x = min(max(np.float32(column) + x, none), last_x)
                c = min(int(at_x), width - 2)
                fx = at_x - np.float32(c)
                behind = none
                for channel in range(3, -1, -1):
                    left, right = iris[r, c, channel], iris[r, c + 1, channel]
                    top = left + fx * (right - left)
                    left, right = iris[r + 1, c, channel], iris[r + 1, c + 1, channel]
                    value = (top + fy * ((left + fx * (right - left)) - top)) * opening[row, column]
                    if channel == 3:
                        behind = whole - value
                    eye[channel] = value + behind * eye[channel]
            lids = whole - over[row, column, 3]
            cover = over[row, column, 3] + lids * eye[3]
            for channel in range(3):
                value = over[row, column, channel] + lids * eye[channel]
                value += (whole - cover) * np.float32(target[channel, y0 + row, x0 + column])
                target[channel, y0 + row, x0 + column] = np.uint8(value + np.float32(0.5))


@compiled
def to_layer(planes: Bytes, y0: int, x0: int, layer: Singles) -> None:
    """Copy a window of planes to an opaque layer [shape=(h, w, 4)], as ``kernels.painting`` paints on."""
    for row in range(layer.shape[0]):
        for column in range(layer.shape[1]):
            for channel in range(3):
                layer[row, column, channel] = np.float32(planes[channel, y0 + row, x0 + column])
            layer[row, column, 3] = np.float32(1)


@compiled
def from_layer(layer: Singles, y0: int, x0: int, planes: Bytes) -> None:
    """Copy an opaque layer [shape=(h, w, 4)] to a window of planes, rounded."""
    for row in range(layer.shape[0]):
        for column in range(layer.shape[1]):
            for channel in range(3):
                planes[channel, y0 + row, x0 + column] = np.uint8(layer[row, column, channel] + np.float32(0.5))
