"""Coordinates of the face in the picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.floating[Any]]
"""Colours 0..255, cover 0..1, or lengths; float32 unless a caller chose otherwise."""


@dataclass(frozen=True)
class View:
    """A square picture of ``size`` pixels with the coordinates of the drawing.

    Coordinates are in eye distances: origin between the eyes, x to the right, y downwards.
    """

    size: int

    @property
    def scale(self) -> float:
        """Pixels in one eye distance."""
        return 0.285 * self.size

    @property
    def origin(self) -> tuple[float, float]:
        """The pixel position (x, y) of the point between the eyes."""
        return self.size / 2, 0.4 * self.size

    def window(self, left: float, top: float, right: float, bottom: float) -> Window:
        """Return the pixels that cover a rectangle given in eye distances, cut at the picture's edges."""
        corners = np.array([[left, top], [right, bottom]])
        return Window(self, 0, 0, self.size, self.size).around(corners, 0)


@dataclass(frozen=True)
class Window:
    """The pixels x0 <= x < x1, y0 <= y < y1 of a view."""

    view: View
    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def area(self) -> tuple[slice, slice]:
        """The index of these pixels in an image array."""
        return slice(self.y0, self.y1), slice(self.x0, self.x1)

    def area_in(self, outer: Window) -> tuple[slice, slice]:
        """Return the index of these pixels in the array of an enclosing window."""
        x, y = outer.x0, outer.y0
        return slice(self.y0 - y, self.y1 - y), slice(self.x0 - x, self.x1 - x)

    def around(self, points: NDArray[np.float64], margin: float) -> Window:
        """Return the part of this window within ``margin`` of the bounding box of points; unit: eye distances."""
        first = np.floor((points.min(axis=0) - margin) * self.view.scale + self.view.origin).astype(int)
        last = np.ceil((points.max(axis=0) + margin) * self.view.scale + self.view.origin).astype(int)
        x0, y0 = np.clip(first, (self.x0, self.y0), (self.x1 - 1, self.y1 - 1)).tolist()
        x1, y1 = np.clip(last, (x0 + 1, y0 + 1), (self.x1, self.y1)).tolist()
        return Window(self.view, x0, y0, x1, y1)

    def columns(self, per_pixel: int = 1) -> Pixels:
        """Return the x of ``per_pixel`` evenly spaced columns in every pixel, in eye distances."""
        steps = (np.arange((self.x1 - self.x0) * per_pixel) + 0.5) / per_pixel + self.x0
        return ((steps - self.view.origin[0]) / self.view.scale).astype(np.float32)

    def rows(self) -> Pixels:
        """Return the y of the pixel centres, in eye distances."""
        steps = np.arange(self.y0, self.y1) + 0.5
        return ((steps - self.view.origin[1]) / self.view.scale).astype(np.float32)
