"""Painting between two heights over the columns of a picture, with exact coverage and without a supersampled bitmap.

Heights are sampled at ``COLUMNS`` columns per pixel [shape=(COLUMNS, W)]; along each of them the covered
part of a pixel is exact. The cost is that of the painted pixels only.
"""

from __future__ import annotations

import numpy as np

from lipmotion.faces.portrait.palette import Colour
from lipmotion.faces.portrait.view import Pixels, Window

COLUMNS = 4


class Bands:
    """A picture to paint bands on, in place.

    picture : float array [shape=(H, W, 3)], 0..255
    x       : positions of the pixel centres [shape=(W,)]
    y       : positions of the pixel centres [shape=(H, 1)]
    pixel   : size of a pixel
    """

    def __init__(self, picture: Pixels, x: Pixels, y: Pixels, pixel: float) -> None:
        self.picture, self.x, self.y, self.pixel = picture, x, y, pixel

    @classmethod
    def of(cls, picture: Pixels, window: Window) -> Bands:
        """Return the canvas for the pixels of a window."""
        return cls(picture, window.columns(), window.rows()[:, None], 1 / window.view.scale)

    def between(self, top: float, bottom: float) -> Bands:
        """Return the canvas of the rows between two heights; it shares its pixels with this one."""
        first, last = np.searchsorted(self.y[:, 0], (top - self.pixel, bottom + self.pixel))
        return Bands(self.picture[first:last], self.x, self.y[first:last], self.pixel)

    def fill(self, top: Pixels, bottom: Pixels, colour: Colour | Pixels, opacity: Pixels | float = 1) -> None:
        """Paint from ``top`` down to ``bottom`` [shape=(COLUMNS, W)]; nothing where they meet.

        colour, opacity : one value, or one for every pixel (opacity: or for every column)
        """
        edge = self.y / self.pixel - 0.5
        lower = np.minimum((bottom / self.pixel)[:, None], edge + 1)
        lower -= np.maximum((top / self.pixel)[:, None], edge)
        np.maximum(lower, 0, out=lower)
        self.blend(lower.sum(axis=0) * (opacity / COLUMNS), colour)

    def blend(self, cover: Pixels, colour: Colour | Pixels) -> None:
        """Mix a colour into every pixel by its coverage, 0..1 [shape=(H, W)]."""
        difference = np.asarray(colour, dtype=np.float32) - self.picture
        difference *= cover[..., None]
        self.picture += difference

    def depth(self, top: Pixels, bottom: Pixels) -> Pixels:
        """Return the position of every pixel between two heights, 0 at the top, 1 at the bottom [shape=(H, W)]."""
        first, last = top.mean(axis=0), bottom.mean(axis=0)
        share: Pixels = np.clip((self.y - first) / np.maximum(last - first, self.pixel), 0, 1)
        return share
