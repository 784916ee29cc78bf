"""The background sequence: which part of the footage it is, and in which order its frames are shown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.filmed.face import StoredBackground
from lipmotion.faces.filmed.renderer import Background
from lipmotion.storage.coded_video import encode_video
from lipmotion.vision.footage import Footage, footage_frames

MOST_BACKGROUND_S = 10.0


def best_background(footages: Sequence[Footage]) -> StoredBackground:
    """Return the best part of some footage."""
    footage = max(footages, key=len)
    count = min(len(footage), round(MOST_BACKGROUND_S * footage.rate_hz))
    height, width = (length // 2 * 2 for length in footage.size)
    frames = (frame[:height, :width] for frame in footage_frames(footage, 0, count))
    return StoredBackground(encode_video(frames, "video"), footage.rate_hz, footage.face_to_image[:count])


def pingpong(count: int, frames: int) -> NDArray[np.intp]:
    """Return frames in order."""
    n = np.arange(frames) % max(1, 2 * (count - 1))
    return np.where(n < count, n, 2 * (count - 1) - n)


def stored_frames(background: StoredBackground, frames: int) -> Iterator[Background]:
    """Yield frames."""
    order = pingpong(len(background.video), frames)
    for number, frame in zip(order, background.video.frames(order.tolist()), strict=True):
        yield Background(frame, background.face_to_frame[number])
