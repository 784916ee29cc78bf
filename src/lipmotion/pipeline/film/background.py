"""The background sequence: which part of the footage it is, and in which order its frames are shown."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from lipmotion.appearance.mouth_region import CORNER, EYE_DISTANCE_PX, HEIGHT
from lipmotion.faces.filmed.face import StoredBackground
from lipmotion.faces.filmed.renderer import Background
from lipmotion.storage.coded_video import encode_video
from lipmotion.storage.frame_groups import FrameGroups
from lipmotion.vision.footage import Footage, footage_frames, footage_groups, track_footage
from lipmotion.vision.frames import VideoSpan
from lipmotion.vision.steadying import registered_maps, steady_maps

MOST_BACKGROUND_S = 10.0
"""Longest background that is kept in the file of a face."""
HEAD_PX = -75.0, -80.0, 75.0, 150.0
"""Left, top, right and bottom of a head, px of the face, from the point between the eyes."""
CHIN = "y_152"
"""The tip of the chin."""
SMOOTHING_FRAMES = 0.7
"""Standard deviation of the smoothing of its place, frames: the tracker trembles."""
MOST_TRACKED_S = 120.0
"""Seconds of a video that are used as a background."""


@dataclass(frozen=True, eq=False)
class BackgroundSequence:
    """Footage that can be shown for any length.

    groups        : returns access to its frames, in any order
    rate_hz       : frames a second
    face_to_frame : affine maps from px of the face to px of the frame [shape=(T, 2, 3)]
    chin_px       : how far the tip of the chin is below the eyes, px of the face [shape=(T,)]
    """

    groups: Callable[[], FrameGroups]
    rate_hz: float
    face_to_frame: NDArray[np.float64]
    chin_px: NDArray[np.float64]

    @property
    def face_box(self) -> tuple[float, float, float, float]:
        """The part of the frames in which the face is at any time: left, top, right and bottom, px."""
        corners = np.array([[x, y, 1.0] for x in HEAD_PX[::2] for y in HEAD_PX[1::2]])
        places = (self.face_to_frame @ corners.T).swapaxes(1, 2).reshape(-1, 2)
        least, most = places.min(axis=0), places.max(axis=0)
        return float(least[0]), float(least[1]), float(most[0]), float(most[1])

    def enlarged(self, zoom: float) -> BackgroundSequence:
        """Return the same background, on which a mouth is ``zoom`` times as large, in the same place."""
        middle = np.array([0.0, CORNER[1] + HEIGHT / 2])
        maps = self.face_to_frame.copy()
        maps[:, :, 2] += maps[:, :, :2] @ middle * (1 - zoom)
        maps[:, :, :2] *= zoom
        return replace(self, face_to_frame=maps)

    def frames(self, count: int, rate_hz: float) -> Iterator[Background]:
        """Yield ``count`` frames at a rate: forwards, backwards, and so on."""
        seconds = count / rate_hz
        order = pingpong(len(self.chin_px), int(np.ceil(seconds * self.rate_hz)) + 1)
        groups = self.groups()
        for number in order[np.floor(np.arange(count) * (self.rate_hz / rate_hz) + 0.5).astype(int)].tolist():
            frame = groups.frame(number)
            height, width = (length // 2 * 2 for length in frame.shape[:2])
            yield Background(frame[:height, :width], self.face_to_frame[number], float(self.chin_px[number]))


def best_background(footages: Sequence[Footage]) -> StoredBackground:
    """Return the best part of some footage."""
    footage = max(footages, key=len)
    count = min(len(footage), round(MOST_BACKGROUND_S * footage.rate_hz))
    height, width = (length // 2 * 2 for length in footage.size)
    frames = (frame[:height, :width] for frame in footage_frames(footage, 0, count))
    return StoredBackground(
        encode_video(frames, footage.rate_hz), placed_maps(footage)[:count], chin_px(footage)[:count]
    )


def stored_sequence(background: StoredBackground) -> BackgroundSequence:
    """Return the background in the file of a face."""
    video = background.video
    return BackgroundSequence(video.groups, video.rate_hz, background.face_to_frame, background.chin_px)


def open_background(path: Path) -> BackgroundSequence:
    """Return a video as a background; at most ``MOST_TRACKED_S`` of it.

    Raises InputError: no video, or no face in it.
    """
    footage = track_footage(path, VideoSpan(0.0, MOST_TRACKED_S))
    return BackgroundSequence(partial(footage_groups, footage), footage.rate_hz, placed_maps(footage), chin_px(footage))


def chin_px(footage: Footage) -> NDArray[np.float64]:
    """Return how far the tip of the chin is below the eyes in every frame, px of the face [shape=(T,)]."""
    return -EYE_DISTANCE_PX * gaussian_filter1d(np.asarray(footage.track.motion[CHIN], np.float64), SMOOTHING_FRAMES)


def placed_maps(footage: Footage) -> NDArray[np.float64]:
    """Return where the face is in every frame of some footage, without the noise of tracking [shape=(T, 2, 3)]."""
    return steady_maps(registered_maps(footage), footage.rate_hz, footage.cuts)


def pingpong(count: int, frames: int) -> NDArray[np.intp]:
    """Return the numbers of frames, forwards and backwards in turn [shape=(frames,)]."""
    place = np.arange(frames) % max(1, 2 * (count - 1))
    return np.where(place < count, place, 2 * (count - 1) - place)
