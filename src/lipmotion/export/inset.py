"""A picture in a corner of a video: a large mouth beside the speaker's own, as an aid to lip-reading."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from lipmotion.appearance.placing import cut

Frame = NDArray[np.uint8]

WIDTH_SHARE, HEIGHT_SHARE = 0.33, 0.4
"""Largest width and height of the inset, as shares of the frame's."""
MARGIN_SHARE = 0.02
"""Distance from the edges of the frame, as a share of its shorter side."""
BORDER_SHARE = 0.006
"""Width of the white border, as a share of the frame's shorter side."""
WHITE = 245


def inset_box(frame: tuple[int, int], picture: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return the part of a frame that the inset covers, with its border: left, top, right and bottom, px.

    frame, picture : heights and widths, px
    """
    height, width = frame
    shorter = min(height, width)
    factor = min(WIDTH_SHARE * width / picture[1], HEIGHT_SHARE * height / picture[0])
    rows, columns = (max(1, round(length * factor)) for length in picture)
    bottom, right = (length - round(MARGIN_SHARE * shorter) for length in frame)
    border = border_px(frame)
    return right - columns - 2 * border, bottom - rows - 2 * border, right, bottom


def border_px(frame: tuple[int, int]) -> int:
    """Return the width of the border in a frame of some height and width, px."""
    return max(1, round(BORDER_SHARE * min(frame)))


def with_inset(frames: Iterable[Frame], pictures: Iterable[Frame]) -> Iterator[Frame]:
    """Yield frames with a picture in the lower right corner; as many as there are of both.

    frames   : uint8 RGB [each shape=(H, W, 3)], of one size; they are not changed
    pictures : uint8 RGB [each shape=(h, w, 3)], of one size, enlarged or reduced by cubic interpolation
    """
    for frame, picture in zip(frames, pictures, strict=False):
        size = (frame.shape[0], frame.shape[1])
        left, top, right, bottom = inset_box(size, (picture.shape[0], picture.shape[1]))
        border = border_px(size)
        rows, columns = bottom - top - 2 * border, right - left - 2 * border
        steps = picture.shape[1] / columns, picture.shape[0] / rows
        to_picture = np.array([[steps[0], 0, steps[0] / 2 - 0.5], [0, steps[1], steps[1] / 2 - 0.5]])
        enlarged = cut(picture, to_picture, (rows, columns))
        result = frame.copy()
        result[top:bottom, left:right] = WHITE
        inner = result[top + border : bottom - border, left + border : right - border]
        inner[...] = np.clip(np.rint(enlarged), 0, 255)
        yield result
