"""A video to the motion of lips and jaw."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types import Channel, Motion, Track
from lipmotion.vision.frames import open_video
from lipmotion.vision.landmarks import DISTANCES, EYE_CORNERS, JAW_POINTS, LIP_POINTS, TRACKED_POINTS
from lipmotion.vision.mesh import FaceMesh
from lipmotion.vision.mouth import mouth_crop
from lipmotion.vision.pose import head_frame
from lipmotion.vision.timing import at_constant_rate, frame_count, nearest, nominal_rate_hz

Array = NDArray[np.float64]

UNSEEN_LIMIT = 0.2
"""A clip is refused when more than this share of its frames shows no face."""
STRETCH_LIMIT = 2.0
"""A clip is refused when its time stamps span more than this many times the frames that it holds."""

COLUMN = {index: n for n, index in enumerate(TRACKED_POINTS)}
CHANNELS = tuple(
    Channel(name)
    for name in (*DISTANCES, *(f"{axis}_{index}" for index in (*LIP_POINTS, *JAW_POINTS) for axis in "xyz"))
)
"""``opening``, ``width``, ``outer``, then ``x_i, y_i, z_i`` for every lip and jaw point, in eye distances."""


@dataclass(eq=False)
class _Sighting:
    """What was found in the frames so far; ``points`` and ``crops`` only of those that show a face."""

    times_s: list[float] = field(default_factory=list)
    seen: list[bool] = field(default_factory=list)
    points: list[Array] = field(default_factory=list)
    crops: list[NDArray[np.uint8]] = field(default_factory=list)


def track(path: Path, *, crops: bool = True) -> Track:
    """Follow the face in a video and return how lips and jaw move, head motion removed.

    path  : a video that shows one face, more or less from the front
    crops : cut out the mouth images as well
    Returns a Track at the video's nominal frame rate, frame n at n / rate seconds after the container's start, not
    smoothed. Frames that were dropped, or show no face, are interpolated, marked in ``seen``, and have the mouth image
    of the nearest frame with a face.
    Raises InputError: not a video, damaged, or no face in more than ``UNSEEN_LIMIT`` of the frames.
    Raises MissingDependencyError: MediaPipe or OpenCV is not installed.
    """
    sighting = _Sighting()
    with open_video(path) as video, FaceMesh() as mesh:
        for frame in video.frames:
            points = mesh.points(frame.image)
            sighting.times_s.append(frame.time_s)
            sighting.seen.append(points is not None)
            if points is not None:
                sighting.points.append(points)
                if crops:
                    sighting.crops.append(mouth_crop(frame.image, points[[COLUMN[i] for i in EYE_CORNERS], :2]))
    times_s = np.array(sighting.times_s)
    rate_hz = nominal_rate_hz(times_s, video.stated_rates_hz)
    _check(path, np.array(sighting.seen), frame_count(times_s, rate_hz), rate_hz)
    return _assembled(sighting, rate_hz, frame_count(times_s, rate_hz))


def motion_values(points: Array) -> Array:
    """Return the channels of tracked frames.

    points : array [shape=(T, len(TRACKED_POINTS), 3)], px, x to the right, y down, z away from the camera
    Returns array [shape=(T, len(CHANNELS))]
    """
    flat = points[:, :, :2]
    unit = _distance(flat, EYE_CORNERS)
    distances = np.stack([_distance(flat, pair) / unit for pair in DISTANCES.values()], axis=1)
    head = head_frame(points * (1, -1, -1), TRACKED_POINTS)
    spoken = head[:, [COLUMN[index] for index in (*LIP_POINTS, *JAW_POINTS)]]
    return np.concatenate([distances, spoken.reshape(len(points), -1)], axis=1)


def _distance(flat: Array, pair: tuple[int, int]) -> Array:
    distance: Array = np.linalg.norm(flat[:, COLUMN[pair[0]]] - flat[:, COLUMN[pair[1]]], axis=1)
    return distance


def _check(path: Path, seen: NDArray[np.bool_], count: int, rate_hz: float) -> None:
    unseen = int((~seen).sum())
    if unseen > UNSEEN_LIMIT * len(seen):
        raise InputError(
            f"{path}: no face in {unseen} of {len(seen)} frames; required: a face in at least "
            f"{1 - UNSEEN_LIMIT:.0%} of them, one person, from the front"
        )
    if count > STRETCH_LIMIT * len(seen):
        raise InputError(
            f"{path}: {len(seen)} frames span {count / rate_hz:.1f} s, {count} were expected at {rate_hz:g} Hz; "
            "convert the video to a constant frame rate"
        )


def _assembled(sighting: _Sighting, rate_hz: float, count: int) -> Track:
    times_s = np.array(sighting.times_s)[sighting.seen]
    values = at_constant_rate(times_s, motion_values(np.stack(sighting.points)), rate_hz, count)
    wanted_s = np.arange(count) / rate_hz
    index = nearest(times_s, wanted_s)
    seen = np.abs(times_s[index] - wanted_s) * rate_hz <= 0.5
    crops = np.stack(sighting.crops)[index] if sighting.crops else None
    return Track(Motion(values, rate_hz, CHANNELS), seen, crops)
