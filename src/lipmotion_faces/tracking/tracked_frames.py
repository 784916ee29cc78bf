"""A face followed through a video: which pictures show it, and where its points are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion_faces.tracking.face_follower import FaceFollower
from lipmotion_faces.tracking.frames import OpenVideo, VideoSpan, damage_notes, open_video
from lipmotion_faces.tracking.image_similarity import mouth_thumbnail, occluded_mouths
from lipmotion_faces.tracking.landmarks import EYE_CORNERS, TRACKED_POINTS
from lipmotion_faces.tracking.mouth_pictures import eyes_to_image, mouth_crop
from lipmotion_faces.tracking.timing import check_rate, frame_count, nominal_rate_hz
from lipmotion_faces.tracking.trackers import MEDIAPIPE

Array = NDArray[np.float64]

UNSEEN_LIMIT = 0.2
"""A clip is refused when more than this share of its frames shows no face."""
USABLE_SHARE = 0.5
"""A clip is refused when its pictures cover less than this share of the duration that it states."""
SMALL_EYES_PX = 35.0
"""A smaller median distance between the eyes is reported. GRID clips made small and tracked have a correlation of the
opening with the clip as it was of 0.99 at 65 px, 0.98 at 40, 0.90 at 25."""
STRETCH_LIMIT = 2.0
"""A clip is refused when its time stamps span more than this many times the frames that it holds."""

_COLUMN = {index: n for n, index in enumerate(TRACKED_POINTS)}
_EYES = [_COLUMN[index] for index in EYE_CORNERS]


@dataclass(frozen=True, eq=False)
class TrackedFrames:
    """The pictures of a video, as they were decoded, and the points of the face that was followed.

    times_s : the time of every picture, since the start of the container or of the span, rising, s [shape=(S,)]
    seen    : whether the picture shows the person, and nothing covers the mouth [shape=(S,)]
    points  : ``TRACKED_POINTS`` in the pictures that are seen, px, x to the right, y down, z away from the camera
              [shape=(seen.sum(), N, 3)]
    sizes   : the sizes of the pictures, (H, W); most videos have only one
    cuts    : pictures before which the camera changes, or the picture changes to or from somebody else, rising
    rate_hz : nominal frame rate
    notes   : remarks on damage, cuts, other faces, a covered mouth, a small face
    """

    times_s: Array
    seen: NDArray[np.bool_]
    points: Array
    sizes: frozenset[tuple[int, int]]
    cuts: tuple[int, ...]
    rate_hz: float
    notes: tuple[str, ...]

    @property
    def seen_s(self) -> Array:
        """The times of the pictures that are seen, s [shape=(seen.sum(),)]."""
        return self.times_s[self.seen]

    @property
    def count(self) -> int:
        """The number T of frames at the constant rate, frame n at n / rate_hz seconds."""
        return frame_count(self.times_s, self.rate_hz)


@dataclass(eq=False)
class _Found:
    """The frames so far: times, and whether each shows the face; points and mouth thumbnails of those that do."""

    times_s: list[float] = field(default_factory=list)
    seen: list[bool] = field(default_factory=list)
    points: list[Array] = field(default_factory=list)
    mouths: list[NDArray[np.uint8]] = field(default_factory=list)
    sizes: set[tuple[int, int]] = field(default_factory=set)

    def add(self, time_s: float, image: NDArray[np.uint8], points: Array | None) -> None:
        self.times_s.append(time_s)
        self.seen.append(points is not None)
        self.sizes.add((image.shape[0], image.shape[1]))
        if points is not None:
            self.points.append(points)
            self.mouths.append(mouth_thumbnail(mouth_crop(image, eyes_to_image(points[_EYES, :2]))))

    def mark_unseen(self, wrong: NDArray[np.bool_]) -> int:
        """Mark some of the frames that show a face as if they did not [shape=(number of them,)]; return how many."""
        for index in np.flatnonzero(self.seen)[wrong]:
            self.seen[index] = False
        right = np.flatnonzero(~wrong)
        self.points = [self.points[n] for n in right]
        self.mouths = [self.mouths[n] for n in right]
        return int(wrong.sum())


def tracked_frames(path: Path, span: VideoSpan, person: Sequence[Array], tracker: str = MEDIAPIPE) -> TrackedFrames:
    """Return the pictures of a video and where one person's face is in them; the video is decoded once.

    path, span, person, tracker, and errors : as of ``vision.track.track``
    Memory: the points of every frame; no picture is kept.
    """
    found = _Found()
    with open_video(path, span) as video, FaceFollower(person, tracker) as follower:
        for frame in video.frames:
            found.add(frame.time_s, frame.image, follower.points(frame.image))
    if not found.times_s:
        raise InputError(f"{path}: no picture from {span.start_s:.2f} to {span.end_s:.2f} s; give a whole video")
    others = found.mark_unseen(~follower.person()[found.seen])
    covered = found.mark_unseen(occluded_mouths(np.stack(found.mouths))) if found.mouths else 0
    times_s, cuts = np.array(found.times_s), tuple(follower.cuts())
    rate_hz = nominal_rate_hz(times_s, video.stated_rates_hz)
    notes = (
        *damage_notes(video, times_s, rate_hz),
        *(f"cut at {times_s[index]:.2f} s" for index in cuts),
        *([f"another face, or one that is not recognised, in {others} frames"] if others else []),
        *([f"the mouth is covered, or the picture damaged, in {covered} frames"] if covered else []),
        *_smallness(found.points),
    )
    _check(path, times_s, np.array(found.seen), video, rate_hz, notes)
    return TrackedFrames(
        times_s, np.array(found.seen), np.stack(found.points), frozenset(found.sizes), cuts, rate_hz, notes
    )


def distance_px(points: Array, pair: tuple[int, int]) -> Array:
    """Return the distance in the image between two face-mesh points in every frame, px [shape=(T,)].

    points : array [shape=(T, len(TRACKED_POINTS), 3)], px
    """
    between = points[:, _COLUMN[pair[0]], :2] - points[:, _COLUMN[pair[1]], :2]
    distance: Array = np.linalg.norm(between, axis=1)
    return distance


def _smallness(points: list[Array]) -> list[str]:
    """Return a note on a face that is too small to be measured well."""
    if not points:
        return []
    unit_px = float(np.median(distance_px(np.stack(points), EYE_CORNERS)))
    if unit_px >= SMALL_EYES_PX:
        return []
    return [f"the face is small: {unit_px:.0f} px between the eyes, {SMALL_EYES_PX:.0f} give a good track; film closer"]


def _check(
    path: Path, times_s: Array, seen: NDArray[np.bool_], video: OpenVideo, rate_hz: float, notes: tuple[str, ...]
) -> None:
    check_rate(rate_hz, path)
    count = frame_count(times_s, rate_hz)
    noted = f" ({'; '.join(notes)})" if notes else ""
    if count < USABLE_SHARE * video.stated_s * rate_hz:
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
