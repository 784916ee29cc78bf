"""Cutting an aligned patch, such as the mouth, out of a frame, and blending a new one in, wherever the head is."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import smooth_step
from lipmotion.errors import InputError
from lipmotion_faces.kernels import affine

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Pictures = NDArray[np.uint8] | NDArray[np.floating[Any]]
MAX_SAMPLES = 16
"""Maximum samples along each side of a pixel that are averaged where the frame is larger than the patch."""


def cut(frame: NDArray[np.uint8], to_frame: Array, size: tuple[int, int]) -> Floats:
    """Return an aligned patch of a frame: float32 array [shape=(h, w, 3)], grey levels, which may leave 0 to 255.

    frame    : uint8 array [shape=(H, W, 3)]; pixels outside it repeat its outermost ones
    to_frame : affine map [shape=(2, 3)] from the centre of a pixel of the patch to its position in the frame
    size     : height and width of the patch
    Where a pixel of the patch covers 1.5 × 1.5 or more pixels of the frame, enough samples of it are averaged that no
    pixel of the frame is skipped.
    Raises InputError: not such a frame or map.
    """
    _check_frame(frame)
    _check_map(to_frame)
    turn = to_frame[:, :2]
    samples = min(MAX_SAMPLES, max(1, round(np.sqrt(abs(np.linalg.det(turn))))))
    if samples == 1:
        return affine.resample(frame[None], to_frame, size)[0]
    first = to_frame[:, 2] + turn.sum(axis=1) * (0.5 / samples - 0.5)
    finer = np.column_stack([turn / samples, first])
    fine = affine.resample(frame[None], finer, (size[0] * samples, size[1] * samples))[0]
    patch = np.zeros((*size, frame.shape[2]), np.float32)
    for row in range(samples):
        for column in range(samples):
            patch += fine[row::samples, column::samples]
    patch /= samples * samples
    return patch


def invert_map(to_source: Array) -> Array:
    """Return the inverse of an affine map [shape=(2, 3)]. Raises InputError: a map that cannot be inverted."""
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
    return smooth_step(distance / width_px).astype(np.float32)


def place(frame: NDArray[np.uint8], patch: Pictures, weight: Floats, to_frame: Array) -> None:
    """Blend an aligned patch into a frame, which is changed: frame + weight · (patch − frame).

    frame    : uint8 array [shape=(H, W, 3)]
    patch    : [shape=(h, w, 3)], grey levels, most often of ``CloningSystem.clone``
    weight   : [shape=(h, w)], of ``feather``; 0 on the outermost pixels, or they are seen as an edge
    to_frame : affine map [shape=(2, 3)] from the centre of a pixel of the patch to its position in the frame
    The part of the patch that lies outside the frame is left out. Pixels with weight 0 stay as they are, to the bit.
    Raises InputError: no such frame, a weight of another size than the patch, or a map that cannot be inverted.
    """
    _check_frame(frame)
    if patch.ndim != 3 or patch.shape[2] != 3 or weight.shape != patch.shape[:2]:
        raise InputError(f"weight of shape {weight.shape} for a patch of {patch.shape}; required (h, w) and (h, w, 3)")
    to_patch = invert_map(to_frame)
    height, width = weight.shape
    corners = to_frame[:, :2] @ np.array([[-1, width, -1, width], [-1, -1, height, height]]) + to_frame[:, 2:]
    left, top = (max(0, int(np.floor(values.min()))) for values in corners)
    right, bottom = (
        min(limit, int(np.ceil(values.max())) + 1) for values, limit in zip(corners, frame.shape[1::-1], strict=True)
    )
    if left >= right or top >= bottom:
        return
    shifted = np.concatenate([to_patch[:, :2], to_patch[:, 2:] + to_patch[:, :2] @ [[left], [top]]], axis=1)
    affine.blend(frame, (top, left), (bottom - top, right - left), patch, weight, shifted)


def _check_frame(frame: NDArray[np.uint8]) -> None:
    if frame.ndim != 3 or frame.shape[2] != 3 or not frame.size or frame.dtype != np.uint8:
        raise InputError(f"frame of shape {frame.shape} and type {frame.dtype}, required (H, W, 3) and uint8")


def _check_map(affine: Array) -> None:
    if affine.shape != (2, 3) or not np.isfinite(affine).all() or abs(np.linalg.det(affine[:, :2])) < 1e-9:
        raise InputError(
            f"affine map of shape {affine.shape}: {np.array2string(affine, precision=3)}; required (2, 3), finite, and "
            "not flat; a frame without a face has no map"
        )
