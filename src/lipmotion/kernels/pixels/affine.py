"""Resampling of pictures by affine maps: cubic convolution or bilinear, and blending of a patch into a frame."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.choice import compiled_pays

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Pictures = NDArray[Any]
Kind = Literal["linear", "cubic"]
"""Interpolation between pixels: bilinear from 2 × 2, or bicubic from 4 × 4 of them."""
Taps = list[tuple[NDArray[np.intp], Floats]]
"""Index and weight of the pixels along one side that each new pixel is made of, in ascending order [shapes=(N,)]."""
PIXEL_S = 0.15e-6
"""Time that NumPy takes for a new pixel of three colours (docs/results/video.md)."""
COLOURS = 3


def resample(pictures: Pictures, to_source: Array, size: tuple[int, int], kind: Kind) -> Floats:
    """Return new pictures: float32 array [shape=(T, h, w, C)].

    pictures  : uint8 or floats [shape=(T, H, W, C)]; outside them their outermost pixels repeat
    to_source : affine map [shape=(2, 3)] from the centre of a new pixel (column, row) to its position in the given ones
    size      : h and w
    Source: Keys 1981 (cubic convolution with a = -½, which reproduces second-degree polynomials).
    """
    if pictures.dtype != np.uint8:
        pictures = pictures.astype(np.float32, copy=False)
    new = np.empty((len(pictures), *size, pictures.shape[3]), np.float32)
    if _is_compiled(new[..., 0].size, pictures.shape[3], kind):
        from lipmotion.kernels.compiled import affine

        to_source = _plain(to_source, np.float64)
        for picture, made in zip(_plain(pictures), new, strict=True):
            affine.resample(picture, to_source, made)
        return new
    rows, columns = _taps(to_source, pictures.shape[1:3], size, kind)
    for picture, made in zip(pictures, new, strict=True):
        made[...] = _mixed(picture, rows, columns).reshape(made.shape)
    return new


def blend(
    frame: NDArray[np.uint8], corner: tuple[int, int], size: tuple[int, int], patch: Pictures, weight: Floats,
    to_patch: Array, kind: Kind,
) -> None:  # fmt: skip
    """Blend a patch into a part of a frame, which is changed: frame + weight · (patch − frame), rounded, 0 to 255.

    frame    : uint8 array [shape=(H, W, 3)]
    corner   : row and column at which the part begins
    size     : its height and width; it lies in the frame
    patch    : uint8 or floats [shape=(h, w, 3)]
    weight   : [shape=(h, w)], interpolated bilinearly
    to_patch : affine map [shape=(2, 3)] from the centre of a pixel of the part to its position in the patch
    kind     : how to interpolate the patch
    """
    if patch.dtype != np.uint8:
        patch = patch.astype(np.float32, copy=False)
    weight = _plain(weight, np.float32)
    if _is_compiled(size[0] * size[1], patch.shape[2], kind):
        from lipmotion.kernels.compiled import affine

        affine.blend(frame, *corner, size, _plain(patch), weight, _plain(to_patch, np.float64))
        return
    new = _mixed(patch, *_taps(to_patch, patch.shape[:2], size, kind)).reshape(*size, -1)
    share = _mixed(weight[..., None], *_taps(to_patch, weight.shape, size, "linear")).reshape(*size, 1)
    part = frame[corner[0] : corner[0] + size[0], corner[1] : corner[1] + size[1]]
    part[...] = np.clip(np.rint(part + share * (new - part)), 0, 255)


def _is_compiled(pixels: int, colours: int, kind: Kind) -> bool:
    return kind == "cubic" and colours == COLOURS and compiled_pays(pixels * PIXEL_S)


def _plain(values: NDArray[Any], dtype: Any = None) -> NDArray[Any]:
    """Return an array that is contiguous and may be written to: for other ones numba would compile everything again."""
    return np.require(values, dtype, ["C", "W"])


def _taps(to_source: Array, source_size: tuple[int, ...], size: tuple[int, int], kind: Kind) -> tuple[Taps, Taps]:
    """Return the taps of the rows and of the columns, for the new pixels counted row by row."""
    r, c = np.arange(size[0], dtype=float)[:, None], np.arange(size[1], dtype=float)
    found = []
    for (by_column, by_row, start), length in zip(to_source, source_size[::-1], strict=True):
        position = np.clip(by_column * c + (by_row * r + start), -3, length + 2).ravel()
        first = np.floor(position)
        weights = _weights((position - first).astype(np.float32), kind)
        offsets = range(2) if kind == "linear" else range(-1, 3)
        found.append(
            [
                (np.clip(first.astype(np.intp) + offset, 0, length - 1), weight)
                for offset, weight in zip(offsets, weights, strict=True)
            ]
        )
    return found[1], found[0]


def _weights(t: Floats, kind: Kind) -> Iterator[Floats]:
    if kind == "linear":
        yield 1 - t
        yield t
        return
    yield ((1 - 0.5 * t) * t - 0.5) * t
    yield (1.5 * t - 2.5) * t * t + 1
    yield ((2 - 1.5 * t) * t + 0.5) * t
    yield (0.5 * t - 0.5) * t * t


def _mixed(picture: Pictures, rows: Taps, columns: Taps) -> Floats:
    """Return the new pixels [shape=(N, C)]."""
    top, bottom = rows[0][0].min(), rows[-1][0].max() + 1
    left, right = columns[0][0].min(), columns[-1][0].max() + 1
    part = np.asarray(picture[top:bottom, left:right], np.float32)
    flat, width = part.reshape(-1, part.shape[2]), part.shape[1]
    result: Floats = np.zeros(0, np.float32)
    for column, across in columns:
        mixed: Floats = np.zeros(0, np.float32)
        for row, down in rows:
            taken = flat.take((row - top) * width + (column - left), axis=0)
            taken *= down[:, None]
            mixed = taken if not mixed.size else np.add(mixed, taken, out=mixed)
        mixed *= across[:, None]
        result = mixed if not result.size else np.add(result, mixed, out=result)
    return result
