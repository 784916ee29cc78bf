"""Tracking: a video to the motion of lips and jaw, and mouth pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import Channel, Motion, Track
from lipmotion_faces.tracking.frames import WHOLE, VideoSpan, open_video
from lipmotion_faces.tracking.head_pose import without_head_motion
from lipmotion_faces.tracking.landmarks import DISTANCES, EYE_CORNERS, JAW_POINTS, LIP_POINTS, TRACKED_POINTS
from lipmotion_faces.tracking.mouth_pictures import face_to_image, mouth_crop
from lipmotion_faces.tracking.timing import nearest_indices, resample_to_constant_rate
from lipmotion_faces.tracking.tracked_frames import TrackedFrames, distance_px, tracked_frames
from lipmotion_faces.tracking.trackers import MEDIAPIPE

Array = NDArray[np.float64]

COLUMN = {index: n for n, index in enumerate(TRACKED_POINTS)}
CHANNELS = tuple(
    Channel(name)
    for name in (*DISTANCES, *(f"{axis}_{index}" for index in (*LIP_POINTS, *JAW_POINTS) for axis in "xyz"))
)
"""``opening``, ``width``, ``outer``, then ``x_i, y_i, z_i`` for every lip and jaw point, in eye distances."""


def track(
    path: Path,
    *,
    crops: bool = True,
    span: VideoSpan = WHOLE,
    person: Sequence[NDArray[np.float64]] = (),
    tracker: str = MEDIAPIPE,
) -> Track:
    """Return the motion of lips and jaw in a video, without head motion, and the mouth pictures.

    path    : a video that shows one face, more or less from the front
    crops   : whether mouth pictures are wanted
    span    : the part of the video that is tracked
    person  : thumbnails of the face that is wanted, of ``VideoScan``; without any, the one with the most frames
    tracker : name of the tracker that finds the face and its points (``vision.trackers``)
    Returns a Track at the video's nominal frame rate, frame n at n / rate seconds after the start of the container, or
    of the span, not smoothed. Frames that were dropped or damaged, show no face or another one, or in which the mouth
    is occluded, are interpolated, False in ``seen``, and have the mouth picture of the nearest frame that is seen. Of
    several people the largest and most central is followed. ``notes`` reports damage, cuts, other faces, and a face
    that is very small.
    Raises InputError: not a video, damaged or cut short before half of it, or the face in too few of the frames; no
    tracker of that name.
    Raises MissingDependencyError: MediaPipe, or what another tracker needs, or OpenCV is not installed.
    """
    return track_of(path, span, tracked_frames(path, span, person, tracker), crops=crops)


def track_of(path: Path, span: VideoSpan, frames: TrackedFrames, *, crops: bool) -> Track:
    """Return the motion of lips and jaw in tracked frames of a video, as ``track`` does."""
    mouths = _mouths(path, span, frames) if crops else None
    times_s = frames.seen_s
    values = resample_to_constant_rate(times_s, motion_values(frames.points), frames.rate_hz, frames.count)
    wanted_s = np.arange(frames.count) / frames.rate_hz
    index = nearest_indices(times_s, wanted_s)
    seen = np.abs(times_s[index] - wanted_s) * frames.rate_hz <= 0.5
    nearest = None if mouths is None else mouths[index]
    return Track(Motion(values, frames.rate_hz, CHANNELS), seen, nearest, frames.notes)


def motion_values(points: Array) -> Array:
    """Return the values of ``CHANNELS`` in tracked frames [shape=(T, len(CHANNELS))].

    points : array [shape=(T, len(TRACKED_POINTS), 3)], px, x to the right, y down, z away from the camera
    """
    unit = distance_px(points, EYE_CORNERS)
    distances = np.stack([distance_px(points, pair) / unit for pair in DISTANCES.values()], axis=1)
    head = without_head_motion(points * (1, -1, -1), TRACKED_POINTS)
    moving = head[:, [COLUMN[index] for index in (*LIP_POINTS, *JAW_POINTS)]]
    return np.concatenate([distances, moving.reshape(len(points), -1)], axis=1)


def _mouths(path: Path, span: VideoSpan, frames: TrackedFrames) -> NDArray[np.uint8]:
    """Return the mouth picture of every frame that shows the face [shape=(n, 56, 72, 3)].

    The video is decoded once more: the head pose depends on all frames, and the frames do not fit into memory.
    """
    maps = iter(face_to_image(frames.points))
    with open_video(path, span) as video:
        shown = zip(frames.seen, video.frames, strict=False)
        return np.stack([mouth_crop(frame.image, next(maps)) for seen, frame in shown if seen])
