"""Tracking: a video to the motion of lips and jaw, and mouth pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types import Channel, Motion, Track
from lipmotion.vision.face_follower import FaceFollower
from lipmotion.vision.frames import WHOLE, OpenVideo, VideoSpan, damage_notes, open_video
from lipmotion.vision.image_similarity import mouth_thumbnail, occluded_mouths
from lipmotion.vision.landmarks import DISTANCES, EYE_CORNERS, JAW_POINTS, LIP_POINTS, TRACKED_POINTS
from lipmotion.vision.mouth import eyes_to_image, face_to_image, mouth_crop
from lipmotion.vision.pose import without_head_motion
from lipmotion.vision.timing import (
    check_rate,
    frame_count,
    nearest_indices,
    nominal_rate_hz,
    resample_to_constant_rate,
)

Array = NDArray[np.float64]

UNSEEN_LIMIT = 0.2
"""A clip is refused when more than this share of its frames shows no face."""
USABLE = 0.5
"""A clip is refused when its pictures cover less than this share of the duration that it states."""
SMALL_EYES_PX = 35.0
"""A smaller median distance between the eyes is reported. GRID clips made small and tracked have a correlation of the
opening with the clip as it was of 0.99 at 65 px, 0.98 at 40, 0.90 at 25."""
STRETCH_LIMIT = 2.0
"""A clip is refused when its time stamps span more than this many times the frames that it holds."""

COLUMN = {index: n for n, index in enumerate(TRACKED_POINTS)}
CHANNELS = tuple(
    Channel(name)
    for name in (*DISTANCES, *(f"{axis}_{index}" for index in (*LIP_POINTS, *JAW_POINTS) for axis in "xyz"))
)
"""``opening``, ``width``, ``outer``, then ``x_i, y_i, z_i`` for every lip and jaw point, in eye distances."""


@dataclass(eq=False)
class _TrackedFrames:
    """The frames so far: times, and whether each shows the face; points and mouth thumbnails of those that do."""

    times_s: list[float] = field(default_factory=list)
    seen: list[bool] = field(default_factory=list)
    points: list[Array] = field(default_factory=list)
    mouths: list[NDArray[np.uint8]] = field(default_factory=list)

    def add(self, time_s: float, image: NDArray[np.uint8], points: Array | None) -> None:
        self.times_s.append(time_s)
        self.seen.append(points is not None)
        if points is not None:
            eyes = points[[COLUMN[i] for i in EYE_CORNERS], :2]
            self.points.append(points)
            self.mouths.append(mouth_thumbnail(mouth_crop(image, eyes_to_image(eyes))))

    def mark_unseen(self, wrong: NDArray[np.bool_]) -> int:
        """Mark some of the frames that show a face as if they did not [shape=(number of them,)]; return how many."""
        for index in np.flatnonzero(self.seen)[wrong]:
            self.seen[index] = False
        right = np.flatnonzero(~wrong)
        self.points = [self.points[n] for n in right]
        self.mouths = [self.mouths[n] for n in right]
        return int(wrong.sum())


def track(
    path: Path, *, crops: bool = True, span: VideoSpan = WHOLE, person: Sequence[NDArray[np.float64]] = ()
) -> Track:
    """Return the motion of lips and jaw in a video, without head motion, and the mouth pictures.

    path   : a video that shows one face, more or less from the front
    crops  : whether mouth pictures are wanted
    span   : the part of the video that is tracked
    person : thumbnails of the face that is wanted, of ``VideoScan``; without any, the one with the most frames
    Returns a Track at the video's nominal frame rate, frame n at n / rate seconds after the start of the container, or
    of the span, not smoothed. Frames that were dropped or damaged, show no face or another one, or in which the mouth
    is occluded, are interpolated, False in ``seen``, and have the mouth picture of the nearest frame that is seen. Of
    several people the largest and most central is followed. ``notes`` reports damage, cuts, other faces, and a face
    that is very small.
    Raises InputError: not a video, damaged or cut short before half of it, or the face in too few of the frames.
    Raises MissingDependencyError: MediaPipe or OpenCV is not installed.
    """
    tracked = _TrackedFrames()
    with open_video(path, span) as video, FaceFollower(person) as follower:
        for frame in video.frames:
            tracked.add(frame.time_s, frame.image, follower.points(frame.image))
    if not tracked.times_s:
        raise InputError(f"{path}: no picture from {span.start_s:.2f} to {span.end_s:.2f} s; give a whole video")
    others = tracked.mark_unseen(~follower.person()[tracked.seen])
    covered = tracked.mark_unseen(occluded_mouths(np.stack(tracked.mouths))) if tracked.mouths else 0
    times_s = np.array(tracked.times_s)
    rate_hz = nominal_rate_hz(times_s, video.stated_rates_hz)
    notes = (
        *damage_notes(video, times_s, rate_hz),
        *(f"cut at {times_s[index]:.2f} s" for index in follower.cuts()),
        *([f"another face, or one that is not recognised, in {others} frames"] if others else []),
        *([f"the mouth is covered, or the picture damaged, in {covered} frames"] if covered else []),
        *_smallness(tracked),
    )
    _check(path, tracked, video, rate_hz, notes)
    mouths = _mouths(path, span, tracked) if crops else None
    return replace(_resampled(tracked, mouths, rate_hz, frame_count(times_s, rate_hz)), notes=notes)


def _mouths(path: Path, span: VideoSpan, tracked: _TrackedFrames) -> NDArray[np.uint8]:
    """Return the mouth picture of every frame that shows the face [shape=(n, 56, 72, 3)].

    The video is decoded once more: the head pose depends on all frames, and the frames do not fit into memory.
    """
    maps = iter(face_to_image(np.stack(tracked.points)))
    with open_video(path, span) as video:
        shown = zip(tracked.seen, video.frames, strict=False)
        return np.stack([mouth_crop(frame.image, next(maps)) for seen, frame in shown if seen])


def _smallness(tracked: _TrackedFrames) -> list[str]:
    """Return a note on a face that is too small to be measured well."""
    if not tracked.points:
        return []
    unit_px = float(np.median(_distance(np.stack(tracked.points)[:, :, :2], EYE_CORNERS)))
    if unit_px >= SMALL_EYES_PX:
        return []
    return [f"the face is small: {unit_px:.0f} px between the eyes, {SMALL_EYES_PX:.0f} give a good track; film closer"]


def motion_values(points: Array) -> Array:
    """Return the values of ``CHANNELS`` in tracked frames [shape=(T, len(CHANNELS))].

    points : array [shape=(T, len(TRACKED_POINTS), 3)], px, x to the right, y down, z away from the camera
    """
    flat = points[:, :, :2]
    unit = _distance(flat, EYE_CORNERS)
    distances = np.stack([_distance(flat, pair) / unit for pair in DISTANCES.values()], axis=1)
    head = without_head_motion(points * (1, -1, -1), TRACKED_POINTS)
    moving = head[:, [COLUMN[index] for index in (*LIP_POINTS, *JAW_POINTS)]]
    return np.concatenate([distances, moving.reshape(len(points), -1)], axis=1)


def _distance(flat: Array, pair: tuple[int, int]) -> Array:
    """Return the distance between two points in every frame, px [shape=(T,)]."""
    distance: Array = np.linalg.norm(flat[:, COLUMN[pair[0]]] - flat[:, COLUMN[pair[1]]], axis=1)
    return distance


def _check(path: Path, tracked: _TrackedFrames, video: OpenVideo, rate_hz: float, notes: tuple[str, ...]) -> None:
    times_s, seen = np.array(tracked.times_s), np.array(tracked.seen)
    check_rate(rate_hz, path)
    count = frame_count(times_s, rate_hz)
    noted = f" ({'; '.join(notes)})" if notes else ""
    if count < USABLE * video.stated_s * rate_hz:
        raise InputError(
            f"{path}: pictures for {count / rate_hz:.1f} of {video.stated_s:.1f} s; required at least half{noted}; "
            "export the video again"
        )
    unseen = int((~seen).sum())
    if unseen > UNSEEN_LIMIT * len(seen):
        raise InputError(
            f"{path}: no face in {unseen} of {len(seen)} frames{noted}; required: a face in at least "
            f"{1 - UNSEEN_LIMIT:.0%} of them, one person, from the front"
        )
    if count > STRETCH_LIMIT * len(seen):
        raise InputError(
            f"{path}: {len(seen)} frames span {count / rate_hz:.1f} s, {count} were expected at {rate_hz:g} Hz; "
            "convert the video to a constant frame rate"
        )


def _resampled(tracked: _TrackedFrames, mouths: NDArray[np.uint8] | None, rate_hz: float, count: int) -> Track:
    times_s = np.array(tracked.times_s)[tracked.seen]
    values = resample_to_constant_rate(times_s, motion_values(np.stack(tracked.points)), rate_hz, count)
    wanted_s = np.arange(count) / rate_hz
    index = nearest_indices(times_s, wanted_s)
    seen = np.abs(times_s[index] - wanted_s) * rate_hz <= 0.5
    crops = mouths[index] if mouths is not None else None
    return Track(Motion(values, rate_hz, CHANNELS), seen, crops)
