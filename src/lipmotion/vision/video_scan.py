"""A quick look at a whole video: the times of its pictures, and where the camera changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.vision.frames import open_video
from lipmotion.vision.image_similarity import is_cut, scene_thumbnail

LOOK_PX = 160
"""Pictures are reduced to this while they are converted."""
REPORT_STEP = 250


@dataclass(frozen=True, eq=False)
class VideoScan:
    """The pictures of a video: their times, rising, and the times of those before which the camera changes, s."""

    times_s: NDArray[np.float64]
    cuts_s: NDArray[np.float64]


def scan_video(path: Path, reached: Callable[[float], None] = lambda _: None) -> VideoScan:
    """Return the times and cuts of a video; every picture is decoded once, at a small size.

    reached : called now and then with the share of the stated duration that is done
    Raises InputError: as ``open_video``. Raises MissingDependencyError: OpenCV is not installed.
    """
    times_s, cuts_s, before = [], [], None
    with open_video(path, longest_px=LOOK_PX) as video:
        for frame in video.frames:
            picture = scene_thumbnail(frame.image)
            if is_cut(before, picture):
                cuts_s.append(frame.time_s)
            before = picture
            times_s.append(frame.time_s)
            if len(times_s) % REPORT_STEP == 0 and video.stated_s:
                reached(min(frame.time_s / video.stated_s, 1.0))
    return VideoScan(np.array(times_s), np.array(cuts_s))
