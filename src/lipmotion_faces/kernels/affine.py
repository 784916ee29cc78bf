"""Resampling of pictures of three colours by affine maps, by cubic convolution, and blending of a patch into a frame.

Source: Keys 1981 (cubic convolution with a = -½, which reproduces second-degree polynomials).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiler import compiled

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Pictures = NDArray[Any]
Index = NDArray[np.int32]
Number = np.float32
HALF, ONE, ONE_AND_HALF, TWO, TWO_AND_HALF = Number(0.5), Number(1), Number(1.5), Number(2), Number(2.5)
BLACK, WHITE = Number(0), Number(255)
COLOURS = 3
NEXT = np.uint64(COLOURS)  # indices that may be negative are not vectorised


def resample(pictures: Pictures, to_source: Array, size: tuple[int, int]) -> Floats:
    """Return new pictures: float32 array [shape=(T, h, w, 3)].

    pictures  : uint8 or floats [shape=(T, H, W, 3)]; outside them their outermost pixels repeat
    to_source : affine map [shape=(2, 3)] from the centre of a new pixel (column, row) to its position in the given ones
    size      : h and w
    """
    new = np.empty((len(pictures), *size, COLOURS), np.float32)
    to_source = _pack(to_source, np.float64)
    for picture, made in zip(_pack(pictures), new, strict=True):
        _resample(picture, to_source, made)
    return new


def blend(
    frame: NDArray[np.uint8], corner: tuple[int, int], size: tuple[int, int], patch: Pictures, weight: Floats,
    to_patch: Array,
) -> None:  # fmt: skip
    """Blend a patch into a part of a frame, which is changed: frame + weight · (patch − frame), rounded, 0 to 255.

    frame    : uint8 array [shape=(H, W, 3)]
    corner   : row and column at which the part begins
    size     : its height and width; it lies in the frame
    patch    : uint8 or floats [shape=(h, w, 3)]
    weight   : [shape=(h, w)], interpolated bilinearly
    to_patch : affine map [shape=(2, 3)] from the centre of a pixel of the part to its position in the patch
    """
    _blend(frame, *corner, size, _pack(patch), _pack(weight, np.float32), _pack(to_patch, np.float64))


def _pack(values: NDArray[Any], dtype: Any = None) -> NDArray[Any]:
    """Return an array that is contiguous and may be written to: for other ones numba would compile everything again."""
    return np.require(values, dtype or (None if values.dtype == np.uint8 else np.float32), ["C", "W"])


@compiled
def _resample(picture: Pictures, to_source: Array, new: Floats) -> None:
    width = new.shape[1]
    cells, fractions, taps = np.empty((2, width), np.int32), np.empty((2, width), Number), np.empty((8, width), Number)
    needed = np.ones(width, Number)
    for r in range(len(new)):
        _locate(to_source, r, picture.shape, cells, fractions)
        _weigh(fractions, taps)
        _fill(picture, cells, taps, needed, new[r])


@compiled
def _blend(
    frame: NDArray[np.uint8],
    top: int,
    left: int,
    size: tuple[int, int],
    patch: Pictures,
    weight: Floats,
    to_patch: Array,
) -> None:
    width = size[1]
    cells, fractions, taps = np.empty((2, width), np.int32), np.empty((2, width), Number), np.empty((8, width), Number)
    share, new = np.empty(width, Number), np.empty((width, COLOURS), Number)
    for r in range(size[0]):
        _locate(to_patch, r, patch.shape, cells, fractions)
        _share(weight, cells, fractions, share)
        _weigh(fractions, taps)
        _fill(patch, cells, taps, share, new)
        _mix(frame[top + r, left : left + width], new, share)


@compiled
def _locate(to_source: Array, r: int, shape: tuple[int, int, int], cells: Index, fractions: Floats) -> None:
    """Fill in where the pixels of row ``r`` lie in a picture of ``shape``: columns and rows, fractions of both."""
    from_x, from_y = to_source[0, 1] * r + to_source[0, 2], to_source[1, 1] * r + to_source[1, 2]
    for c in range(cells.shape[1]):
        x = min(max(to_source[0, 0] * c + from_x, -3.0), shape[1] + 2.0)
        y = min(max(to_source[1, 0] * c + from_y, -3.0), shape[0] + 2.0)
        column, row = np.floor(x), np.floor(y)
        cells[0, c], cells[1, c] = np.int32(column), np.int32(row)
        fractions[0, c], fractions[1, c] = Number(x - column), Number(y - row)


@compiled
def _weigh(fractions: Floats, taps: Floats) -> None:
    """Fill in the weights of the four columns and of the four rows around each position [shape=(8, w)]."""
    for side in range(2):
        for c in range(fractions.shape[1]):
            t = fractions[side, c]
            taps[4 * side, c] = ((ONE - HALF * t) * t - HALF) * t
            taps[4 * side + 1, c] = (ONE_AND_HALF * t - TWO_AND_HALF) * t * t + ONE
            taps[4 * side + 2, c] = ((TWO - ONE_AND_HALF * t) * t + HALF) * t
            taps[4 * side + 3, c] = (HALF * t - HALF) * t * t


@compiled
def _fill(picture: Pictures, cells: Index, taps: Floats, needed: Floats, new: Floats) -> None:
    """Fill in a row: vertical sums of four columns, and their weighted sum; not where ``needed`` is 0."""
    height, width, _ = picture.shape
    flat, below = picture.reshape(-1), np.uint64(width * COLOURS)
    for c in range(len(new)):
        if needed[c] == BLACK:
            continue
        column, row = cells[0, c], cells[1, c]
        e, f, g, h = taps[4, c], taps[5, c], taps[6, c], taps[7, c]
        if 1 <= column < width - 2 and 1 <= row < height - 2:
            first = np.uint64((np.int64(row) - 1) * width + column - 1) * NEXT
            for k in range(COLOURS):
                at = first + np.uint64(k)
                new[c, k] = (
                    taps[0, c] * _sum(flat, at, below, e, f, g, h)
                    + taps[1, c] * _sum(flat, at + NEXT, below, e, f, g, h)
                    + taps[2, c] * _sum(flat, at + NEXT + NEXT, below, e, f, g, h)
                    + taps[3, c] * _sum(flat, at + NEXT + NEXT + NEXT, below, e, f, g, h)
                )
        else:
            for k in range(COLOURS):
                new[c, k] = BLACK
                for i in range(4):
                    new[c, k] += taps[i, c] * _sum_at_edge(picture, row, column - 1 + i, k, e, f, g, h)


@compiled
def _sum(
    flat: Pictures, at: np.uint64, below: np.uint64, e: np.float32, f: np.float32, g: np.float32, h: np.float32
) -> np.float32:
    """Return the weighted sum of four pixels that lie below one another, the first of which is at ``at``."""
    upper = e * Number(flat[at]) + f * Number(flat[at + below])
    return upper + g * Number(flat[at + below + below]) + h * Number(flat[at + below + below + below])


@compiled
def _sum_at_edge(
    picture: Pictures, row: int, column: int, k: int, e: np.float32, f: np.float32, g: np.float32, h: np.float32
) -> np.float32:
    """Return the weighted sum of four pixels of a column around ``row``; outermost pixels repeat."""
    height, column = len(picture), _clip(column, picture.shape[1])
    upper = e * Number(picture[_clip(row - 1, height), column, k]) + f * Number(picture[_clip(row, height), column, k])
    lower = g * Number(picture[_clip(row + 1, height), column, k])
    return upper + lower + h * Number(picture[_clip(row + 2, height), column, k])


@compiled
def _share(weight: Floats, cells: Index, fractions: Floats, share: Floats) -> None:
    """Fill in the weight at each position, interpolated between 2 × 2 pixels."""
    height, width = weight.shape
    for c in range(len(share)):
        x, y = fractions[0, c], fractions[1, c]
        above, below = _clip(cells[1, c], height), _clip(cells[1, c] + 1, height)
        left, right = _clip(cells[0, c], width), _clip(cells[0, c] + 1, width)
        before = (ONE - y) * weight[above, left] + y * weight[below, left]
        share[c] = (ONE - x) * before + x * ((ONE - y) * weight[above, right] + y * weight[below, right])


@compiled
def _mix(row: NDArray[np.uint8], new: Floats, share: Floats) -> None:
    for c in range(len(row)):
        if share[c] != BLACK:
            for k in range(COLOURS):
                old = Number(row[c, k])
                row[c, k] = np.uint8(min(max(np.rint(old + share[c] * (new[c, k] - old)), BLACK), WHITE))


@compiled
def _clip(index: int, length: int) -> int:
    return min(max(index, 0), length - 1)
