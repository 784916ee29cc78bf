"""The background sequence: which part of the footage it is, and in which order its frames are shown."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.filmed.face import StoredBackground
from lipmotion.faces.filmed.renderer import Background
from lipmotion.storage.coded_video import encode_video
from lipmotion.vision.footage import Footage, footage_frames, track_footage
from lipmotion.vision.frames import VideoSpan
from lipmotion.vision.steadying import registered_maps, steady_maps

MOST_BACKGROUND_S = 10.0
"""Longest background that is kept in the file of a face."""
MOST_TRACKED_S = 120.0
"""Seconds of a video that are used as a background."""


@dataclass(frozen=True, eq=False)
class BackgroundSequence:
    """Footage that can be shown for any length.

    count         : number of its frames
    rate_hz       : frames a second
    face_to_frame : affine maps from px of the face to px of the frame [shape=(count, 2, 3)]
    read          : yields frames by their numbers
    """

    count: int
    rate_hz: float
    face_to_frame: NDArray[np.float64]
    read: Callable[[list[int]], Iterator[NDArray[np.uint8]]]

    def frames(self, count: int, rate_hz: float) -> Iterator[Background]:
        """Yield ``count`` frames at a rate: forwards, backwards, and so on."""
        seconds = count / rate_hz
        order = pingpong(self.count, int(np.ceil(seconds * self.rate_hz)) + 1)
        shown = order[np.floor(np.arange(count) * (self.rate_hz / rate_hz) + 0.5).astype(int)].tolist()
        for number, frame in zip(shown, self.read(shown), strict=True):
            yield Background(frame, self.face_to_frame[number])


def best_background(footages: Sequence[Footage]) -> StoredBackground:
    """Return the best part of some footage."""
    footage = max(footages, key=len)
    count = min(len(footage), round(MOST_BACKGROUND_S * footage.rate_hz))
    video = encode_video(_even(footage_frames(footage, 0, count), footage.size), "video")
    return StoredBackground(video, footage.rate_hz, placed_maps(footage)[:count])


def stored_sequence(background: StoredBackground) -> BackgroundSequence:
    """Return the background in the file of a face."""
    video = background.video
    return BackgroundSequence(len(video), background.rate_hz, background.face_to_frame, video.frames)


def open_background(path: Path) -> BackgroundSequence:
    """Return a video as a background; at most ``MOST_TRACKED_S`` of it.

    Raises InputError: no video, or no face in it.
    """
    footage = track_footage(path, VideoSpan(0.0, MOST_TRACKED_S))

    def read(numbers: list[int]) -> Iterator[NDArray[np.uint8]]:
        forwards = all(later >= sooner for sooner, later in pairwise(numbers))
        frames = _even(footage_frames(footage, 0, max(numbers) + 1), footage.size)
        if not forwards:
            yield from encode_video(frames, "video").frames(numbers)
            return
        at, frame = -1, None
        for number in numbers:
            while at < number:
                at, frame = at + 1, next(frames)
            if frame is not None:
                yield frame

    return BackgroundSequence(len(footage), footage.rate_hz, placed_maps(footage), read)


def placed_maps(footage: Footage) -> NDArray[np.float64]:
    """Return where the face is in every frame of some footage, without the noise of tracking [shape=(T, 2, 3)]."""
    return steady_maps(registered_maps(footage), footage.rate_hz, footage.cuts)


def pingpong(count: int, frames: int) -> NDArray[np.intp]:
    """Return the numbers of frames, forwards and backwards in turn [shape=(frames,)]."""
    place = np.arange(frames) % max(1, 2 * (count - 1))
    return np.where(place < count, place, 2 * (count - 1) - place)


def _even(frames: Iterator[NDArray[np.uint8]], size: tuple[int, int]) -> Iterator[NDArray[np.uint8]]:
    """Yield frames without a last row or column that makes their sizes odd."""
    height, width = (length // 2 * 2 for length in size)
    for frame in frames:
        yield frame[:height, :width]
