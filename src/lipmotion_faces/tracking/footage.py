"""Footage: a tracked video whose pictures can be read again, with the place of the face in each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice, pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types import Track
from lipmotion_faces.coded_video import MAX_DECODED_BYTES, FrameGroups
from lipmotion_faces.tracking.frames import WHOLE, VideoSpan, nearest_indices, open_video, resample_to_constant_rate
from lipmotion_faces.tracking.head_pose import face_to_image
from lipmotion_faces.tracking.track import TrackedFrames, make_track, track_frames

Array = NDArray[np.float64]

SAME_TIME_S = 1e-4
"""Times of pictures that differ by less are those of one picture: containers count in whole ticks."""

GROUP = 32
"""Most frames of a video file that are decoded together."""


@dataclass(frozen=True, eq=False)
class Footage:
    """A video of one person, tracked. Frame n is at n / rate_hz seconds after the start of ``span``.

    path          : the video
    span          : the part of the video that was tracked
    track         : motion of the lips and jaw, T frames, and which of them are seen; as ``track.track`` finds it
    face_to_image : affine maps of ``head_pose.face_to_image``, from px of the face that looks ahead to
                    px of the frame [shape=(T, 2, 3)]; in frames that are not seen, interpolated within their scene
    pictures_s    : time of the picture that frame n shows, the one nearest to its time, s since the start of ``span``
                    [shape=(T,)]; equal times in a row are a picture shown again
    cuts          : the frames before which the camera changes, or the picture changes to or from somebody else, rising
    size          : height and width of the pictures, px
    rate_hz       : the video's nominal frame rate
    damaged       : frames that were found to be damaged, of those seen at first [shape=(T,)]; None: none
    """

    path: Path
    span: VideoSpan
    track: Track
    face_to_image: Array
    pictures_s: Array
    cuts: tuple[int, ...]
    size: tuple[int, int]
    rate_hz: float
    damaged: NDArray[np.bool_] | None = None

    def __len__(self) -> int:
        return len(self.pictures_s)


def track_footage(path: Path, span: VideoSpan = WHOLE, *, crops: bool = False) -> Footage:
    """Return a tracked video, and where the face is in every frame of it.

    path, span : as of ``track.track``
    crops      : whether mouth pictures are wanted, for which the video is decoded once more
    Raises InputError and MissingDependencyError: as ``track.track``; InputError also if the pictures of the
    video have several sizes.
    """
    frames = track_frames(path, span, ())
    if len(frames.sizes) > 1:
        several = " and ".join(f"{width} × {height}" for height, width in sorted(frames.sizes)[:3])
        raise InputError(f"{path}: pictures of {several} pixels in one video; export the video in one size")
    wanted_s = np.arange(frames.count) / frames.rate_hz
    times_s, rate_hz, count = frames.seen_s, frames.rate_hz, frames.count
    maps = face_to_image(frames.points).reshape(-1, 6)
    result = maps[nearest_indices(times_s, np.arange(count) / rate_hz)]  # in scenes in which the person is not seen
    ends = [0, *_frames_of_cuts(frames), count]
    for start, stop in pairwise(ends):
        inside = (times_s * rate_hz >= start - 0.5) & (times_s * rate_hz < stop - 0.5)
        if inside.any():
            scene_s = times_s[inside] - start / rate_hz
            result[start:stop] = resample_to_constant_rate(scene_s, maps[inside], rate_hz, stop - start)
    return Footage(
        path,
        span,
        make_track(path, span, frames, crops=crops),
        result.reshape(-1, 2, 3),
        frames.times_s[nearest_indices(frames.times_s, wanted_s)],
        tuple(_frames_of_cuts(frames)),
        next(iter(frames.sizes)),
        frames.rate_hz,
    )


def footage_frames(footage: Footage, start: int = 0, stop: int | None = None) -> Iterator[NDArray[np.uint8]]:
    """Yield frames of a tracked video, from ``start`` (included) to ``stop`` (excluded; None: to the last one).

    Each is a uint8 array [shape=(H, W, 3)], RGB: the picture whose time is nearest to that of the frame, which is shown
    again where pictures were dropped. One picture is in memory at a time; the file is open until the iterator is
    exhausted or closed. The beginning is sought in the file.
    Raises InputError: no such frames, or the video cannot be read or has changed since it was tracked.
    """
    stop = len(footage) if stop is None else stop
    if not 0 <= start <= stop <= len(footage):
        raise InputError(f"frames {start} to {stop} of {footage.path}, required within 0 to {len(footage)}")
    return _frames_between(footage, start, stop)


def footage_groups(footage: Footage, most_bytes: int = MAX_DECODED_BYTES) -> FrameGroups:
    """Return access to the frames of a tracked video in any order, also backwards, in bounded memory.

    most_bytes : decoded frames that are kept
    Reading a frame raises InputError: the video cannot be read, or has changed since it was tracked.
    Cost: forwards each picture is decoded once; backwards, those between the video's own key frame and a group of up to
    ``GROUP`` frames are decoded again for every group. A video that is played backwards often is better copied into a
    ``coded_video.StoredVideo``.
    """
    frame_bytes = footage.size[0] * footage.size[1] * 3
    length = min(GROUP, max(1, most_bytes // (3 * frame_bytes)))
    starts = [*range(0, len(footage), length), len(footage)]
    return FrameGroups(_SequentialReader(footage), starts, most_bytes)


class _SequentialReader:
    def __init__(self, footage: Footage) -> None:
        self._footage = footage
        self._frames: Iterator[NDArray[np.uint8]] = iter(())
        self._next = -1

    def __call__(self, start: int, stop: int) -> list[NDArray[np.uint8]]:
        if start != self._next:
            self._frames = footage_frames(self._footage, start)
        self._next = stop
        return list(islice(self._frames, stop - start))


def _frames_between(footage: Footage, start: int, stop: int) -> Iterator[NDArray[np.uint8]]:
    if start == stop:
        return
    path, times_s = footage.path, footage.pictures_s
    is_first = times_s[start] - times_s[0] < SAME_TIME_S
    begin_s = 0.0 if is_first else float(times_s[start])
    span = footage.span if is_first else VideoSpan(footage.span.start_s + begin_s, footage.span.end_s)
    n, image = start, None
    with open_video(path, span) as video:
        for picture in video.frames:
            image = picture.image
            if image.shape[:2] != footage.size:
                height, width = footage.size
                raise InputError(f"{path}: a picture is not {width} × {height} as when it was tracked; track it again")
            while n < stop and times_s[n] < begin_s + picture.time_s + SAME_TIME_S:
                yield image
                n += 1
            if n == stop:
                return
    if image is None:
        raise InputError(f"{path}: no picture from {begin_s:.2f} s on, though it was tracked; track it again")
    for _ in range(n, stop):
        yield image


def _frames_of_cuts(frames: TrackedFrames) -> list[int]:
    """Return the frames at the constant rate before which there is a cut, rising, without repetition."""
    at = {int(np.ceil(frames.times_s[cut] * frames.rate_hz - 0.5)) for cut in frames.cuts}
    return sorted(n for n in at if 0 < n < frames.count)


def read_video_frames(path: Path) -> tuple[Iterator[NDArray[np.uint8]], float]:
    """Return the frames of a video in constant order, and their rate; no face is looked for.

    Each is a uint8 array [shape=(H, W, 3)], RGB: the last picture that begins at or before the time of the frame. The
    video must be read to its end, or the iterator be closed.
    Raises InputError: no such video, or one that states no frame rate.
    """
    with open_video(path) as video:
        rates = [rate for rate in video.stated_rates_hz if rate > 0]
    if not rates:
        raise InputError(f"{path}: states no frame rate; convert it to a constant one")

    def frames() -> Iterator[NDArray[np.uint8]]:
        shown: NDArray[np.uint8] | None = None
        n = 0
        with open_video(path) as video:
            for picture in video.frames:
                while shown is not None and n / rates[0] < picture.time_s - SAME_TIME_S:
                    yield shown
                    n += 1
                shown = picture.image
        if shown is not None:
            yield shown

    return frames(), rates[0]
