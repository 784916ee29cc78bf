"""Placing an aligned patch into a frame in which the head is anywhere: affine resampling, feathering, blending."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Pictures = NDArray[np.uint8] | NDArray[np.floating[Any]]
Kind = Literal["linear", "cubic"]
"""Interpolation between pixels: bilinear from 2 × 2, or bicubic from 4 × 4 of them."""
SHARPNESS = -0.5
"""The parameter a of cubic convolution (Keys 1981); with -½ second-degree polynomials are reproduced."""


@dataclass(frozen=True, eq=False)
class Resampling:
    """Where the pixels of a new picture lie in a given one, ready for any picture of that size.

    source_size : height and width of the given picture, px
    size        : height and width of the new picture, px
    index       : pixels of the given picture, counted row by row, that each new pixel is made of [shape=(h · w, n)]
    weight      : their weights, whose sum is 1 [shape=(h · w, n)]
    """

    source_size: tuple[int, int]
    size: tuple[int, int]
    index: NDArray[np.intp]
    weight: Floats

    def apply(self, pictures: Pictures) -> Floats:
        """Return the new pictures [shape=(T, h, w, C)]. ``pictures`` : [shape=(T, H, W, C)].

        Raises InputError: pictures of another size.
        """
        if pictures.ndim != 4 or pictures.shape[1:3] != self.source_size:
            height, width = self.source_size
            raise InputError(f"pictures of shape {pictures.shape}, required (T, {height}, {width}, C)")
        flat = pictures.reshape(len(pictures), -1, pictures.shape[3])
        result = np.zeros((len(pictures), len(self.index), pictures.shape[3]), np.float32)
        for index, weight in zip(self.index.T, self.weight.T, strict=True):
            result += flat[:, index] * weight[:, None]
        return result.reshape(len(pictures), *self.size, -1)


def resampling(
    to_source: Array, source_size: tuple[int, int], size: tuple[int, int], kind: Kind = "cubic"
) -> Resampling:
    """Return the resampling of pictures by an affine map.

    to_source   : affine map [shape=(2, 3)] from the centre of a new pixel (x to the right, y down) to its position in
                  the given picture, px, as ``region_to_image`` of ``vision.mouth`` returns it; integers are centres
    source_size : height and width of the given pictures
    size        : height and width of the new pictures
    kind        : how to interpolate. Pixels outside the given picture repeat its outermost ones.
    Raises InputError: not such a map.
    Source: Keys 1981 (cubic). A new picture that is much smaller than the given one would skip pixels: not for that.
    """
    _check_map(to_source)
    rows, columns = np.mgrid[: size[0], : size[1]].reshape(2, -1)
    x, y = to_source[:, :2] @ np.stack([columns, rows]) + to_source[:, 2:]
    offsets = np.arange(2) if kind == "linear" else np.arange(-1, 3)
    near = [np.floor(values).astype(np.intp)[:, None] + offsets for values in (y, x)]
    weights = [_weights(np.abs(values[:, None] - pixels), kind) for values, pixels in zip((y, x), near, strict=True)]
    near_rows, near_columns = (np.clip(pixels, 0, length - 1) for pixels, length in zip(near, source_size, strict=True))
    index = near_rows[:, :, None] * source_size[1] + near_columns[:, None, :]
    weight = weights[0][:, :, None] * weights[1][:, None, :]
    count = len(x)
    return Resampling(source_size, size, index.reshape(count, -1), weight.reshape(count, -1).astype(np.float32))


def inverse_map(to_source: Array) -> Array:
    """Return the affine map that leads back [shape=(2, 3)]. Raises InputError: a map that cannot be inverted."""
    _check_map(to_source)
    turn = np.linalg.inv(to_source[:, :2])
    return np.concatenate([turn, -turn @ to_source[:, 2:]], axis=1)


def feather(mask: NDArray[np.bool_], width_px: float) -> Floats:
    """Return the weight of each pixel of a region in blending: float32 array [shape=(h, w)], 0 to 1.

    mask     : bool array [shape=(h, w)], the region; beyond the outermost pixels nothing belongs to it
    width_px : distance from the first pixel outside at which the weight reaches 1; it rises smoothly (3t² − 2t³)
    Raises InputError: a width below 1 px, which would be a hard edge.
    """
    from scipy.ndimage import distance_transform_edt

    if not width_px >= 1:
        raise InputError(f"feather of {width_px} px, required at least 1")
    distance = distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]
    share = np.clip(distance / width_px, 0, 1)
    weight: Floats = (share * share * (3 - 2 * share)).astype(np.float32)
    return weight


def place(frame: NDArray[np.uint8], patch: Pictures, weight: Floats, to_frame: Array, kind: Kind = "cubic") -> None:
    """Blend an aligned patch into a frame, which is changed: frame + weight · (patch − frame).

    frame    : uint8 array [shape=(H, W, 3)]
    patch    : [shape=(h, w, 3)], grey levels, most often of ``CloningSystem.clone``
    weight   : [shape=(h, w)], of ``feather``; 0 on the outermost pixels, or they are seen as an edge
    to_frame : affine map [shape=(2, 3)] from the centre of a pixel of the patch to its position in the frame
    The part of the patch that lies outside the frame is left out. Pixels with weight 0 stay as they are, to the bit.
    Raises InputError: a weight of another size than the patch, or a map that cannot be inverted.
    """
    if patch.ndim != 3 or weight.shape != patch.shape[:2]:
        raise InputError(f"weight of shape {weight.shape} for a patch of {patch.shape}; required (h, w) and (h, w, 3)")
    to_patch = inverse_map(to_frame)
    height, width = weight.shape
    corners = to_frame[:, :2] @ np.array([[-1, width, -1, width], [-1, -1, height, height]]) + to_frame[:, 2:]
    left, top = (max(0, int(np.floor(values.min()))) for values in corners)
    right, bottom = (
        min(limit, int(np.ceil(values.max())) + 1) for values, limit in zip(corners, frame.shape[1::-1], strict=True)
    )
    if left >= right or top >= bottom:
        return
    shifted = np.concatenate([to_patch[:, :2], to_patch[:, 2:] + to_patch[:, :2] @ [[left], [top]]], axis=1)
    size = (bottom - top, right - left)
    new = resampling(shifted, (height, width), size, kind).apply(patch[None])[0]
    share = resampling(shifted, (height, width), size, "linear").apply(weight[None, :, :, None])[0]
    box = frame[top:bottom, left:right]
    box[...] = np.clip(np.rint(box + share * (new - box)), 0, 255)


def _weights(distance: Array, kind: Kind) -> Array:
    if kind == "linear":
        return 1 - distance
    a = SHARPNESS
    near = ((a + 2) * distance - (a + 3)) * distance**2 + 1
    far = a * (((distance - 5) * distance + 8) * distance - 4)
    return np.where(distance <= 1, near, far)


def _check_map(affine: Array) -> None:
    if affine.shape != (2, 3) or not np.isfinite(affine).all() or abs(np.linalg.det(affine[:, :2])) < 1e-9:
        raise InputError(
            f"affine map of shape {affine.shape}: {np.array2string(affine, precision=3)}; required (2, 3), finite, and "
            "not flat; a frame without a face has no map"
        )


def cut(frame: NDArray[np.uint8], to_frame: Array, size: tuple[int, int], kind: Kind = "cubic") -> Floats:
    """Return a patch of a frame [shape=(h, w, 3)]."""
    return resampling(to_frame, frame.shape[:2], size, kind).apply(frame[None])[0]
