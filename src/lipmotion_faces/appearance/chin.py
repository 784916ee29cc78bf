"""The chin of recorded pictures, moved: what is between mouth and neck is stretched or compressed, down and up.

The tip of a chin moves against collar and hair, which cloning cannot mend: pictures of another moment have them
elsewhere. So the outline of the jaw stays that of the footage, and is moved to where speech wants it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.appearance.lower_face import CORNER, HEIGHT, WIDTH

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Pictures = NDArray[np.uint8]

STILL_PX = 74.0
"""Above this, about the middle of the mouth, nothing is moved."""
ABOVE_PX, BELOW_PX = 8.0, 4.0
"""The skin so far above and below the tip of the chin moves as the tip does;"""
NECK_PX = 26.0
"""and so far below that, nothing."""
HINGE_PX = 75.0
"""Half the distance between the joints of the jaw: the nearer to them, the less it moves."""
SIDE_PX = 46.0, 60.0
"""Between these distances from the middle the movement ends: beyond is what is behind the head."""
LARGEST_PX = 14.0
"""The chin is not moved further: more would fold the neck."""
LARGEST_RISE_SHARE, LARGEST_DROP_SHARE = 0.6, 1.2
"""Nor further than these shares of its distance to what is not moved: more would fold or tear a short chin."""
LEAST_PX = 0.05
"""A smaller movement is none."""
A = -0.5
"""The parameter of cubic convolution (Keys 1981)."""


def moved_part(scale: int) -> Mask:
    """Return where pictures of the lower face may differ from the footage: bool array [shape=(H, W)]."""
    rows, columns = np.mgrid[: HEIGHT * scale, : WIDTH * scale]
    x, y = (columns + 0.5) / scale + CORNER[0], (rows + 0.5) / scale + CORNER[1]
    top, bottom = CORNER[1] + 14.0, CORNER[1] + HEIGHT - 2.0
    middle = (top + bottom) / 2
    return (np.abs(x) / SIDE_PX[1]) ** 4 + (np.abs(y - middle) / (bottom - middle)) ** 4 <= 1


def move_chin(pictures: Pictures, chin_px: Array, drops_px: Array) -> Pictures:
    """Return pictures of the lower face whose chin is lower, or higher.

    pictures : [shape=(T, 128 · scale, 128 · scale, 3)], uint8
    chin_px  : how far the tip of the chin is below the eyes in them, px of the face [shape=(T,)]
    drops_px : how far it is moved down [shape=(T,)]; at most ``LARGEST_PX`` are done, less where the chin is short
    Columns are resampled by cubic convolution.
    """
    scale = pictures.shape[1] // HEIGHT
    result = pictures.copy()
    room = np.maximum(chin_px - ABOVE_PX - STILL_PX, 0)
    highest, lowest = (
        -np.minimum(LARGEST_PX, LARGEST_RISE_SHARE * room),
        np.minimum(LARGEST_PX, LARGEST_DROP_SHARE * room),
    )
    drops = np.clip(drops_px, highest, lowest)
    across = (np.arange(WIDTH * scale) + 0.5) / scale + CORNER[0]
    share = np.maximum(1 - (across / HINGE_PX) ** 2, 0) * (1 - _rise(np.abs(across), *SIDE_PX))
    columns = np.flatnonzero(share > 0)
    for frame in np.flatnonzero(np.abs(drops) >= LEAST_PX):
        by = float(drops[frame]) * share[columns]
        moved = _move_columns(pictures[frame][:, columns], float(chin_px[frame]), by, scale)
        result[frame, :, columns] = moved.swapaxes(0, 1)
    return result


def _move_columns(picture: Pictures, chin_px: float, drops: Array, scale: int) -> Pictures:
    """Return one picture whose columns are moved down by ``drops`` [shape=(W,)] at the chin."""
    down = (np.arange(len(picture)) + 0.5) / scale + CORNER[1]
    tip = chin_px + drops  # where the tip is afterwards
    moved = np.flatnonzero((down > STILL_PX) & (down < tip.max() + BELOW_PX + NECK_PX))
    above = _rise(down[moved, None], STILL_PX, tip - ABOVE_PX)
    below = 1 - _rise(down[moved, None], tip + BELOW_PX, tip + BELOW_PX + NECK_PX)
    position = moved[:, None] - scale * drops * above * below
    first = np.floor(position).astype(np.intp)
    part = (position - first).astype(np.float32)
    levels = np.zeros((*part.shape, picture.shape[2]), np.float32)
    column, pixels = np.arange(picture.shape[1]), picture.reshape(-1, picture.shape[2])
    for tap in range(-1, 3):
        rows = np.clip(first + tap, 0, len(picture) - 1)
        away = np.abs(part - tap)
        near = ((A + 2) * away - (A + 3)) * away**2 + 1
        far = A * (((away - 5) * away + 8) * away - 4)
        weight = np.where(away <= 1, near, np.where(away < 2, far, 0)).astype(np.float32)
        levels += weight[:, :, None] * pixels.take(rows * picture.shape[1] + column, axis=0)
    result = picture.copy()
    result[moved] = np.clip(np.rint(levels), 0, 255)
    return result


def _rise(values: Array, start: Array | float, stop: Array | float) -> Array:
    """Return 0 up to ``start``, 1 from ``stop`` on, and a smooth rise between (3t² − 2t³)."""
    share = np.clip((values - start) / (np.asarray(stop) - start), 0, 1)
    return share * share * (3 - 2 * share)
