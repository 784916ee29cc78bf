"""Paint what lies between two heights over the columns of a picture: exact cover, no supersampled bitmap.

Heights are sampled at ``COLUMNS`` columns a pixel [shape=(COLUMNS, W)]; along each of them the covered
part of a pixel is exact. A shape that changes with every frame costs its own few pixels only.
"""

from __future__ import annotations

import numpy as np

from lipmotion.faces.portrait.palette import Colour
from lipmotion.faces.portrait.view import Pixels, Window

COLUMNS = 4


class Bands:
    """A picture to paint bands on, in place.

    picture : float array [shape=(H, W, 3)], 0..255
    x       : of the pixel centres [shape=(W,)]
    y       : of the pixel centres [shape=(H, 1)]
    """

    def __init__(self, picture: Pixels, x: Pixels, y: Pixels, pixel: float) -> None:
        self.picture, self.x, self.y, self.pixel = picture, x, y, pixel

    @classmethod
    def of(cls, picture: Pixels, window: Window) -> Bands:
        """Return the bands' canvas for the pixels of a window."""
        return cls(picture, window.columns(), window.rows()[:, None], 1 / window.view.scale)

    def between(self, top: float, bottom: float) -> Bands:
        """Return the rows that touch the heights ``top`` to ``bottom``; painting there paints here."""
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
        """Mix a colour into every pixel by its cover, 0..1 [shape=(H, W)]."""
        difference = np.asarray(colour, dtype=np.float32) - self.picture
        difference *= cover[..., None]
        self.picture += difference

    def depth(self, top: Pixels, bottom: Pixels) -> Pixels:
        """Return how far down between two heights every pixel lies, 0..1 [shape=(H, W)]."""
        first, last = top.mean(axis=0), bottom.mean(axis=0)
        share: Pixels = np.clip((self.y - first) / np.maximum(last - first, self.pixel), 0, 1)
        return share
