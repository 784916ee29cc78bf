"""A video as pictures with their times."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.files import check_source


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture.

    time_s : its time, relative to the container's time 0
    image  : uint8 array [shape=(H, W, 3)], RGB, upright, square pixels
    """

    time_s: float
    image: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Video:
    """An open video.

    frames          : the pictures, decoded as they are asked for
    stated_rates_hz : the frame rates that the container states, the most trustworthy first
    """

    frames: Iterator[Frame]
    stated_rates_hz: tuple[float, ...]


@contextmanager
def open_video(path: Path) -> Iterator[Video]:
    """Open the first video stream of a file; memory use does not grow with its length.

    Time 0 is the container's start, as in ``speech.read``, so sound and picture agree.
    Raises InputError: no such file, empty, not a video, no video stream, or damaged before its first picture.
    A file damaged later ends where the damage starts.
    """
    import av

    check_source(path, "video")
    try:
        container = av.open(str(path))
    except (av.FFmpegError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: not a readable video ({reason}); give a video file") from error
    with container:
        if not container.streams.video:
            raise InputError(f"{path}: has no video stream; give a video that shows the speaker's face")
        stream = container.streams.video[0]
        rates = [float(rate) for rate in (stream.guessed_rate, stream.average_rate) if rate]
        with closing(_frames(container, path)) as frames:  # decoding from a closed container would crash
            yield Video(frames, tuple(rates))


def _frames(container: Any, path: Path) -> Generator[Frame, None, None]:
    import av

    start_s = (container.start_time or 0) / 1e6
    pixel_shape = container.streams.video[0].sample_aspect_ratio
    last_s = float("-inf")
    try:
        for picture in container.decode(video=0):
            if picture.time is None or picture.time - start_s <= last_s:
                continue  # without a time, or shown twice: it cannot be placed
            last_s = picture.time - start_s
            yield Frame(last_s, _upright(picture, float(pixel_shape or 1)))
    except av.FFmpegError as error:
        if last_s == float("-inf"):
            raise InputError(f"{path}: no picture can be decoded ({error.strerror}); export the video again") from error
    if last_s == float("-inf"):
        raise InputError(f"{path}: holds no picture; export the video again")


def _upright(picture: Any, pixel_shape: float) -> NDArray[np.uint8]:
    width = round(picture.width * pixel_shape)
    image: NDArray[np.uint8] = picture.to_ndarray(format="rgb24", width=width, height=picture.height)
    return np.ascontiguousarray(np.rot90(image, picture.rotation // 90)) if picture.rotation else image
