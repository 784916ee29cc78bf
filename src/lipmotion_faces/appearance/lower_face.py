"""The lower face: the part of a face that speech moves, from the nose to below the chin, and the mouth region in it.

Pixels are those of the mouth region (``motion.eigenlips``): a head that is upright and faces the camera, its
outer eye corners 90 px apart. Footage of a large face has ``scale`` samples a pixel, along each side.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import smooth_step
from lipmotion.errors import InputError
from lipmotion.motion.eigenlips import EYE_DISTANCE_PX, MOUTH_CORNER, MOUTH_HEIGHT, MOUTH_WIDTH

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Pictures = NDArray[np.uint8]

WIDTH, HEIGHT = 128, 128  # size of a picture of the lower face, px
CORNER = (-64.0, 32.0)  # upper left corner of the region, in px from the point between the eyes, y down
LARGEST_SCALE = 4
"""Most samples a pixel: an eye distance of 360 px. More would make the edge of the region too long to clone."""
TOP_PX = 50.0  # where the part that is replaced begins: under the nose, px below the eyes
MARGIN_PX = 3.0
"""The part that is replaced ends so far above the tip of the chin at its highest: on skin, not on neck or collar."""
JAW_SHARE = 1.15  # half of its width, as a share of half the distance between the ends of the tracked jaw line
NARROWEST_PX, WIDEST_PX = 34.0, 58.0
"""Limits of half its width: the mouth must fit in, and it must fit into the picture."""
MIN_BOTTOM_PX = 106.0  # the part that is replaced holds the mouth, whatever the chin
MOUTH_AXES_PX = 35.0, 27.0
"""Half width and height of the part in which the mouth is replaced: marks of the skin lie in one picture, not two."""
CHEEK_PX = 12, 10
"""Width and height of the corners of the mouth region, in which the light is measured: they show skin in any pose."""


@dataclass(frozen=True)
class FaceShape:
    """How large the lower face is, in px: half the width of the replaced part, and its end below the eyes."""

    half_width_px: float
    bottom_px: float


def measure_shape(jaw_half_width: float, chin_px: Array) -> FaceShape:
    """Return the shape of the replaced part, by how far the chin is below the eyes in all frames [shape=(T,)]."""
    half = float(np.clip(JAW_SHARE * jaw_half_width * EYE_DISTANCE_PX, NARROWEST_PX, WIDEST_PX))
    highest = float(np.percentile(chin_px, 1))
    return FaceShape(half, float(np.clip(highest - MARGIN_PX, MIN_BOTTOM_PX, CORNER[1] + HEIGHT - 4.0)))


def map_region(face_to_frame: Array, scale: float, corner: tuple[float, float] = CORNER) -> Array:
    """Return the affine maps from a pixel of a region of the face to its position in the frame.

    face_to_frame : maps from px of the face to those of the frame [shape=(..., 2, 3)], of
                    ``tracking.head_pose.map_face``
    scale         : samples a pixel, along each side
    corner        : the upper left one of the region, px from the point between the eyes; that of the lower face
    Pixel (0, 0) is a centre. Returns an array of the same shape.
    """
    turn = face_to_frame[..., :2]
    first = np.array(corner) + 0.5 / scale
    return np.concatenate([turn / scale, (face_to_frame[..., 2] - 0.5 + turn @ first)[..., None]], axis=-1)


def choose_scale(face_to_frame: Array) -> int:
    """Return the samples a pixel, 1 to ``LARGEST_SCALE``, with which footage [maps: shape=(T, 2, 3)] loses nothing."""
    size = np.sqrt(np.abs(np.linalg.det(face_to_frame[:, :, :2])))
    return int(np.clip(np.floor(np.median(size) + 0.25), 1, LARGEST_SCALE))


def find_mouth_part(scale: int) -> tuple[slice, slice]:
    """Return the rows and columns of the mouth region in a picture of the lower face."""
    left, top = (round((near - far) * scale) for near, far in zip(MOUTH_CORNER, CORNER, strict=True))
    return slice(top, top + MOUTH_HEIGHT * scale), slice(left, left + MOUTH_WIDTH * scale)


def mark_replaced(shape: FaceShape, scale: int) -> Mask:
    """Return the part of the lower face that is replaced, jaw and mouth: bool array [shape=(H, W)]."""
    middle, half_height = (shape.bottom_px + TOP_PX) / 2, (shape.bottom_px - TOP_PX) / 2
    x, y = _list_positions(scale)
    # wider than an ellipse under the nose, where cheeks and lip are one surface
    inside = (np.abs(x) / shape.half_width_px) ** 2.5 + (np.abs(y - middle) / half_height) ** 2.5
    return inside <= 1


def mark_mouth(scale: int) -> Mask:
    """Return the part in which the mouth is replaced, within the mouth region: bool array [shape=(H, W)]."""
    middle = MOUTH_CORNER[1] + MOUTH_HEIGHT / 2
    x, y = _list_positions(scale)
    return (x / MOUTH_AXES_PX[0]) ** 4 + ((y - middle) / MOUTH_AXES_PX[1]) ** 4 <= 1


def measure_cheek_light(mouths: NDArray[Any]) -> Array:
    """Return the mean colours of the corners of mouth pictures [shape=(T, 3)]. Raises InputError: another size."""
    scale = mouths.shape[1] // MOUTH_HEIGHT if mouths.ndim == 4 else 0
    required = (MOUTH_HEIGHT * scale, MOUTH_WIDTH * scale, 3)
    if not scale or mouths.shape[1:] != required:
        raise InputError(f"pictures of shape {mouths.shape}, required (T, {MOUTH_HEIGHT} · n, {MOUTH_WIDTH} · n, 3)")
    width, height = CHEEK_PX[0] * scale, CHEEK_PX[1] * scale
    corners = [
        mouths[:, rows, columns].mean(axis=(1, 2), dtype=np.float64)
        for rows in (slice(height), slice(-height, None))
        for columns in (slice(width), slice(-width, None))
    ]
    return np.mean(corners, axis=0)


def relight(pictures: Pictures, gains: Array) -> Pictures:
    """Return pictures [shape=(T, H, W, 3)] whose colours are multiplied [gains: shape=(T, 3)], rounded, cut to 255."""
    tables = np.clip(np.rint(np.arange(256) * gains[..., None]), 0, 255).astype(np.uint8)
    result = np.empty_like(pictures)
    for frame, (picture, table) in enumerate(zip(pictures, tables, strict=True)):
        for colour in range(3):
            result[frame, :, :, colour] = table[colour][picture[:, :, colour]]
    return result


def _list_positions(scale: int) -> tuple[Array, Array]:
    """Return x and y of every sample of a lower-face picture, px from the point between the eyes."""
    rows, columns = np.mgrid[: HEIGHT * scale, : WIDTH * scale]
    return (columns + 0.5) / scale + CORNER[0], (rows + 0.5) / scale + CORNER[1]


SAME_PERSON_LIKENESS = 0.78
"""Least likeness of two recordings of one person. Between clips of one person it was 0.83 to 0.99 (four people),
between those of different people up to 0.76, and 0.83 twice in 228 pairs: GRID, and three open talkers."""


def find_signature(pictures: NDArray[Any]) -> NDArray[np.float32]:
    """Return what is compared of the lower faces [shape=(N,)], from pictures [shape=(T, 128, 128, 3)] or their mean."""
    mean = pictures.reshape(-1, HEIGHT, WIDTH, 3).mean(axis=(0, 3), dtype=np.float64)
    part = mean[:110:3, 20:108:3].ravel()  # nose, cheeks and mouth, without neck and background
    centred = part - part.mean()
    return (centred / max(float(np.linalg.norm(centred)), 1e-9)).astype(np.float32)


def compare_faces(one: NDArray[np.float32], other: NDArray[np.float32]) -> float:
    """Return the correlation of two signatures, -1 to 1; below ``SAME_PERSON_LIKENESS`` probably of two people."""
    return float(one @ other)


STILL_PX = 74.0  # above this, about the middle of the mouth, nothing is moved
ABOVE_PX, BELOW_PX = 8.0, 4.0  # the skin so far above and below the tip of the chin moves as the tip does;
NECK_PX = 26.0  # and so far below that, nothing
HINGE_PX = 75.0  # half the distance between the joints of the jaw: the nearer to them, the less it moves
SIDE_PX = 46.0, 60.0  # between these distances from the middle the movement ends: beyond is what is behind the head
LARGEST_PX = 14.0  # the chin is not moved further: more would fold the neck
LARGEST_RISE_SHARE, LARGEST_DROP_SHARE = 0.6, 1.2
"""Nor further than these shares of its distance to what is not moved: more would fold or tear a short chin."""
MIN_PX = 0.05  # a smaller movement is none
A = -0.5  # the parameter of cubic convolution (Keys 1981)


def mark_moved(scale: int) -> Mask:
    """Return where pictures of the lower face may differ from the footage: bool array [shape=(H, W)]."""
    x, y = _list_positions(scale)
    top, bottom = CORNER[1] + 14.0, CORNER[1] + HEIGHT - 2.0
    middle = (top + bottom) / 2
    return (np.abs(x) / SIDE_PX[1]) ** 4 + (np.abs(y - middle) / (bottom - middle)) ** 4 <= 1


def move_chin(pictures: Pictures, chin_px: Array, drops_px: Array) -> Pictures:
    """Return pictures of the lower face whose chin is lower, or higher: what is between mouth and neck is stretched.

    The tip of a chin moves against collar and hair, which cloning cannot mend: pictures of another moment have them
    elsewhere. So the outline of the jaw stays that of the footage, and is moved to where speech wants it.
    pictures : [shape=(T, 128 · scale, 128 · scale, 3)], uint8
    chin_px  : how far the tip of the chin is below the eyes in them, px of the face [shape=(T,)]
    drops_px : how far it is moved down [shape=(T,)]; at most ``LARGEST_PX`` are done, less where the chin is short
    Columns are resampled by cubic convolution.
    """
    scale = pictures.shape[1] // HEIGHT
    result = pictures.copy()
    room = np.maximum(chin_px - ABOVE_PX - STILL_PX, 0)
    highest = -np.minimum(LARGEST_PX, LARGEST_RISE_SHARE * room)
    drops = np.clip(drops_px, highest, np.minimum(LARGEST_PX, LARGEST_DROP_SHARE * room))
    across = (np.arange(WIDTH * scale) + 0.5) / scale + CORNER[0]
    share = np.maximum(1 - (across / HINGE_PX) ** 2, 0) * (1 - _ease(np.abs(across), *SIDE_PX))
    columns = np.flatnonzero(share > 0)
    down = (np.arange(len(pictures[0])) + 0.5) / scale + CORNER[1] if len(pictures) else np.zeros(0)
    for frame in np.flatnonzero(np.abs(drops) >= MIN_PX):
        picture, by = pictures[frame][:, columns], float(drops[frame]) * share[columns]
        tip = float(chin_px[frame]) + by  # where the tip is afterwards
        rows = np.flatnonzero((down > STILL_PX) & (down < tip.max() + BELOW_PX + NECK_PX))
        above = _ease(down[rows, None], STILL_PX, tip - ABOVE_PX)
        below = 1 - _ease(down[rows, None], tip + BELOW_PX, tip + BELOW_PX + NECK_PX)
        position = rows[:, None] - scale * by * above * below
        first = np.floor(position).astype(np.intp)
        part = (position - first).astype(np.float32)
        levels = np.zeros((*part.shape, picture.shape[2]), np.float32)
        column, pixels = np.arange(picture.shape[1]), picture.reshape(-1, picture.shape[2])
        for tap in range(-1, 3):
            sources = np.clip(first + tap, 0, len(picture) - 1)
            away = np.abs(part - tap)
            near = ((A + 2) * away - (A + 3)) * away**2 + 1
            far = A * (((away - 5) * away + 8) * away - 4)
            weight = np.where(away <= 1, near, np.where(away < 2, far, 0)).astype(np.float32)
            levels += weight[:, :, None] * pixels.take(sources * picture.shape[1] + column, axis=0)
        result[frame, rows[:, None], columns] = np.clip(np.rint(levels), 0, 255)
    return result


def _ease(values: Array, start: Array | float, stop: Array | float) -> Array:
    """Return 0 up to ``start``, 1 from ``stop`` on, and a smooth rise between (3t² − 2t³)."""
    return smooth_step((values - start) / (np.asarray(stop) - start))
