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


def with_inset(frames: Iterable[Frame], pictures: Iterable[Frame]) -> Iterator[Frame]:
    """Yield frames with a picture in the lower right corner; as many as there are of both.

    frames   : uint8 RGB [each shape=(H, W, 3)], of one size; they are not changed
    pictures : uint8 RGB [each shape=(h, w, 3)], of one size, enlarged or reduced by cubic interpolation
    """
    for frame, picture in zip(frames, pictures, strict=False):
        height, width = frame.shape[:2]
        shorter = min(height, width)
        factor = min(WIDTH_SHARE * width / picture.shape[1], HEIGHT_SHARE * height / picture.shape[0])
        rows, columns = max(1, round(picture.shape[0] * factor)), max(1, round(picture.shape[1] * factor))
        steps = picture.shape[1] / columns, picture.shape[0] / rows
        to_picture = np.array([[steps[0], 0, steps[0] / 2 - 0.5], [0, steps[1], steps[1] / 2 - 0.5]])
        enlarged = cut(picture, to_picture, (rows, columns))
        margin, border = round(MARGIN_SHARE * shorter), max(1, round(BORDER_SHARE * shorter))
        bottom, right = height - margin, width - margin
        result = frame.copy()
        result[bottom - rows - 2 * border : bottom, right - columns - 2 * border : right] = WHITE
        inner = result[bottom - rows - border : bottom - border, right - columns - border : right - border]
        inner[...] = np.clip(np.rint(enlarged), 0, 255)
        yield result
