"""A quick look at a whole video: the times of its pictures, where the camera changes, and who is in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.tracking.face_follower import FaceFollower
from lipmotion_faces.tracking.frames import check_rate, damage_notes, nominal_rate_hz, open_video
from lipmotion_faces.tracking.image_similarity import is_cut, scene_thumbnail
from lipmotion_faces.tracking.trackers import MEDIAPIPE

LOOK_PX = 640
"""Pictures are reduced to this while they are converted."""
FACE_STEP_S = 2.0
"""How often faces are looked for."""
ALONE_SHARE = 0.9
"""Somebody whose face is in this share of the pictures with a face is taken to be the only person."""
REPORT_STEP = 250


@dataclass(frozen=True, eq=False)
class VideoScan:
    """The pictures of a video.

    times_s : their times, rising, s
    cuts_s  : the times of those before which the camera changes, s
    person  : thumbnails of the face that is seen most, where other people are seen too; else none
    damage  : remarks on pictures that cannot be decoded, or are missing at the end
    """

    times_s: NDArray[np.float64]
    cuts_s: NDArray[np.float64]
    rate_hz: float
    person: tuple[NDArray[np.float64], ...] = ()
    damage: tuple[str, ...] = ()

    @property
    def end_s(self) -> float:
        """End of the last picture, s."""
        return float(self.times_s[-1]) + 1 / self.rate_hz


def scan_video(path: Path, reached: Callable[[float], None] = lambda _: None, tracker: str = MEDIAPIPE) -> VideoScan:
    """Return the times and cuts of a video, and the person in it; every picture is decoded once, at a small size.

    Raises InputError: as ``open_video``, an impossible frame rate, or no tracker of that name.
    Raises MissingDependencyError: OpenCV or MediaPipe is not installed.
    """
    times_s: list[float] = []
    cuts_s: list[float] = []
    before = None
    with open_video(path, longest_px=LOOK_PX) as video, FaceFollower(tracker=tracker) as follower:
        for frame in video.frames:
            picture = scene_thumbnail(frame.image)
            if is_cut(before, picture):
                cuts_s.append(frame.time_s)
            if int(frame.time_s / FACE_STEP_S) != (int(times_s[-1] / FACE_STEP_S) if times_s else -1):
                follower.points(frame.image)
            before = picture
            times_s.append(frame.time_s)
            if len(times_s) % REPORT_STEP == 0 and video.stated_s:
                reached(min(frame.time_s / video.stated_s, 1.0))
        rate_hz = nominal_rate_hz(np.array(times_s), video.stated_rates_hz)
        damage = tuple(damage_notes(video, np.array(times_s), rate_hz))
    check_rate(rate_hz, path)
    return VideoScan(
        np.array(times_s),
        np.array(cuts_s),
        rate_hz,
        tuple([] if follower.share_of_person() >= ALONE_SHARE else follower.thumbnails()),
        damage,
    )
