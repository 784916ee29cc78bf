"""Descriptors of a background's frames: what a viewer would see change from one to another, mouth aside."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError

Array = NDArray[np.float64]
Floats = NDArray[np.floating[Any]]
Scenes = Sequence[tuple[int, int]]

FRAME_CELLS = 32
"""Cells of the thumbnail of the whole frame along its longer side."""
UPPER_FACE = (-54.0, -45.0, 54.0, 42.0)
EYES = (-50.0, -14.0, 50.0, 14.0)
"""Left, top, right and bottom of the regions that are compared with the face aligned, px of the face that looks
straight ahead, from the point between the eyes."""
LOWER_FACE = (-60.0, 42.0, 60.0, 140.0)
"""The region that is replaced, or moves with speech: not compared."""
FACE_STEP, EYES_STEP = 6.0, 4.0
"""Distance of the samples of these regions, px of the face that looks straight ahead."""
LEAST_ORDINARY = (0.2, 0.2, 0.2)
"""Least ordinary difference of neighbouring frames, in the whole frame and the upper face, levels, and of the
place of the face, px of the frame: smaller differences are not seen."""


@dataclass(frozen=True, eq=False)
class FrameDescriptors:
    """What T frames look like, in levels of green.

    whole : thumbnails of the whole frame; the cells of the lower face are 0 in all of them [shape=(T, A)]
    face  : the upper face, aligned [shape=(T, B)]
    eyes  : the eyes, aligned [shape=(T, C)]
    place : x and then y of the eye corners and the mouth in the frame, px [shape=(T, 6)]
    """

    whole: Array
    face: Array
    eyes: Array
    place: Array

    def __len__(self) -> int:
        return len(self.whole)

    def part(self, start: int, stop: int) -> FrameDescriptors:
        """Return the descriptors of frames from ``start`` (included) to ``stop`` (excluded)."""
        return FrameDescriptors(*(rows[start:stop] for rows in (self.whole, self.face, self.eyes, self.place)))

    def standardised(self, scenes: Scenes, fade: int = 1) -> Array:
        """Return rows whose distances count in ordinary differences: that of neighbours has a median of about 1.

        scenes : first frame of each part without a cut, and the one after its last
        fade   : frames over which the whole frame and the place of the face change from one to another; the upper face
                 is aligned, and counts as it is
        Whole frame, upper face and place of the face have the same weight [shape=(T, A + B + 6)].
        """
        groups = []
        for rows, least, frames in zip(
            (self.whole, self.face, self.place), LEAST_ORDINARY, (fade, 1, fade), strict=True
        ):
            steps = [np.linalg.norm(np.diff(rows[start:stop], axis=0), axis=1) for start, stop in scenes]
            different = np.concatenate([part[part > 0] for part in steps])
            ordinary = float(np.median(different)) if len(different) else 0.0
            groups.append(rows / (frames * max(ordinary, least * np.sqrt(rows.shape[1]))))
        return np.concatenate(groups, axis=1) / np.sqrt(len(groups))


def describe_frames(frames: Iterable[NDArray[np.uint8]], face_to_image: Array) -> FrameDescriptors:
    """Return descriptors of the frames of a background.

    frames        : uint8 RGB, all of one size [shape=(H, W, 3)]; taken one at a time
    face_to_image : the affine map of each frame, from px of the face that looks straight ahead to px of the frame
                    [shape=(T, 2, 3)]
    Raises InputError: another number of frames, or frames of several sizes.
    """
    whole, face, eyes = [], [], []
    lower: NDArray[np.bool_] | None = None
    cell = 1
    size: tuple[int, ...] = ()
    for n, frame in enumerate(frames):
        if n == len(face_to_image) or (size and frame.shape != size):
            raise InputError(
                f"frame {n} of shape {frame.shape} with {len(face_to_image)} maps; required as many frames, of one size"
            )
        if not size:
            size, cell = frame.shape, max(1, round(max(frame.shape[:2]) / FRAME_CELLS))
        grey = frame[:, :, 1].astype(np.float32)  # green, of which a camera has most pixels
        thumbnail = _average_cells(grey, cell)
        rows, columns = np.mgrid[: thumbnail.shape[0], : thumbnail.shape[1]]
        centres = np.stack([(columns.ravel() + 0.5) * cell, (rows.ravel() + 0.5) * cell])
        x, y = np.linalg.solve(face_to_image[n][:, :2], centres - face_to_image[n][:, 2:])
        left, top, right, bottom = LOWER_FACE
        hidden = ((x > left) & (x < right) & (y > top) & (y < bottom)).reshape(thumbnail.shape)
        lower = hidden if lower is None else lower | hidden
        whole.append(thumbnail)
        face.append(_sample(grey, face_to_image[n], UPPER_FACE, FACE_STEP))
        eyes.append(_sample(grey, face_to_image[n], EYES, EYES_STEP))
    if len(whole) != len(face_to_image) or lower is None:
        raise InputError(f"{len(whole)} frames with {len(face_to_image)} maps, required as many, at least one")
    points = np.array([[-45.0, 0, 1], [45, 0, 1], [0, 76, 1]]).T
    place = (face_to_image @ points).reshape(len(whole), 6)
    shown = (np.stack(whole) * ~lower).reshape(len(whole), -1)
    alike, eye_levels = np.stack(face).astype(np.float64), np.stack(eyes).astype(np.float64)
    return FrameDescriptors(shown.astype(np.float64), alike, eye_levels, place)


def row_distances(rows: Array) -> Array:
    """Return the distance between every two rows, such as of ``FrameDescriptors.standardised`` [shape=(T, T)]."""
    rows = rows - rows.mean(axis=0)
    power = np.square(rows).sum(axis=1)
    return np.sqrt(np.maximum(power[:, None] + power - 2 * rows @ rows.T, 0))


def _average_cells(grey: Floats, cell: int) -> Floats:
    """Return means of square cells; pixels beyond the last whole cell are left out."""
    height, width = (side // cell for side in grey.shape)
    if not height or not width:
        return grey.mean(keepdims=True)
    if cell == 1:
        return grey
    rows = grey[: height * cell, : width * cell].reshape(height, cell, -1).sum(axis=1)
    return rows.reshape(height, width, cell).sum(axis=2) / cell**2


def _sample(grey: Floats, to_image: Array, box: tuple[float, float, float, float], step: float) -> Floats:
    """Return a region of the aligned face on a grid, each sample the mean of about its part [shape=(N,)]."""
    left, top, right, bottom = box
    scale = float(np.sqrt(abs(np.linalg.det(to_image[:, :2]))))
    shrink = max(1, int(scale * step / 2))
    x, y = np.meshgrid(np.arange(left + step / 2, right, step), np.arange(top + step / 2, bottom, step))
    columns, rows = (to_image[:, :2] @ np.stack([x.ravel(), y.ravel()]) + to_image[:, 2:]) / shrink - 0.5
    image = _average_cells(grey, shrink)
    height, width = image.shape  # bilinear samples; outside, the picture is as at its edge
    rows, columns = np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)
    top, left = np.minimum(rows.astype(int), max(height - 2, 0)), np.minimum(columns.astype(int), max(width - 2, 0))
    below, beside = np.minimum(top + 1, height - 1), np.minimum(left + 1, width - 1)
    down, across = rows - top, columns - left
    upper = (1 - across) * image[top, left] + across * image[top, beside]
    under = (1 - across) * image[below, left] + across * image[below, beside]
    return (1 - down) * upper + down * under
