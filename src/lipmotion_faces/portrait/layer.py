"""Pixels in the coordinates of the face, and a transparent layer of them on which smooth shapes are painted.

Layers are painted once per face; nothing here runs per frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.portrait.design import Colour, Points

SUPERSAMPLING = 4
Pixels = NDArray[np.floating[Any]]  # colours 0..255, coverage 0..1, or lengths; float32 unless a caller chose otherwise


@dataclass(frozen=True)
class View:
    """A square picture of ``size`` pixels with the coordinates of the drawing."""

    size: int

    @property
    def scale(self) -> float:
        """Pixels in one eye distance."""
        return 0.285 * self.size

    @property
    def origin(self) -> tuple[float, float]:
        """The pixel position (x, y) of the point between the eyes."""
        return self.size / 2, 0.4 * self.size

    def cut_window(self, left: float, top: float, right: float, bottom: float) -> Window:
        """Return the pixels that cover a rectangle given in eye distances, cut at the picture's edges."""
        corners = np.array([[left, top], [right, bottom]])
        return Window(self, 0, 0, self.size, self.size).cut_around(corners, 0)


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

    def find_area(self, outer: Window) -> tuple[slice, slice]:
        """Return the index of these pixels in the array of an enclosing window."""
        x, y = outer.x0, outer.y0
        return slice(self.y0 - y, self.y1 - y), slice(self.x0 - x, self.x1 - x)

    def cut_around(self, points: NDArray[np.float64], margin: float) -> Window:
        """Return the part of this window within ``margin`` of the bounding box of points; unit: eye distances."""
        first = np.floor((points.min(axis=0) - margin) * self.view.scale + self.view.origin).astype(int)
        last = np.ceil((points.max(axis=0) + margin) * self.view.scale + self.view.origin).astype(int)
        x0, y0 = np.clip(first, (self.x0, self.y0), (self.x1 - 1, self.y1 - 1)).tolist()
        x1, y1 = np.clip(last, (x0 + 1, y0 + 1), (self.x1, self.y1)).tolist()
        return Window(self.view, x0, y0, x1, y1)

    def list_columns(self, per_pixel: int = 1) -> Pixels:
        """Return the x of ``per_pixel`` evenly spaced columns in every pixel, in eye distances."""
        steps = (np.arange((self.x1 - self.x0) * per_pixel) + 0.5) / per_pixel + self.x0
        return ((steps - self.view.origin[0]) / self.view.scale).astype(np.float32)

    def list_rows(self) -> Pixels:
        """Return the y of the pixel centres, in eye distances."""
        steps = np.arange(self.y0, self.y1) + 0.5
        return ((steps - self.view.origin[1]) / self.view.scale).astype(np.float32)


@dataclass(frozen=True)
class Glow:
    """A soft round spot of colour about (x, y) inside a shape."""

    x: float
    y: float
    radius_x: float
    radius_y: float
    colour: Colour
    strength: float


@dataclass(frozen=True)
class Rim:
    """A soft edge of colour along the inside of a shape's outline."""

    radius: float
    colour: Colour
    strength: float


class Layer:
    """The pixels of a window: premultiplied colour 0..255 and coverage 0..1 [shape=(h, w, 4)]."""

    def __init__(self, window: Window) -> None:
        self.window = window
        self.pixels: Pixels = np.zeros((window.y1 - window.y0, window.x1 - window.x0, 4), dtype=np.float32)

    def fill(
        self,
        outline: Points,
        colour: Colour,
        *shades: Glow | Rim,
        opacity: float = 1.0,
        blur: float = 0.0,
        within: Points | None = None,
    ) -> None:
        """Paint the inside of an outline, and of ``within`` where that is given."""
        softest = max([blur, *(shade.radius for shade in shades if isinstance(shade, Rim))])
        window = self.window.cut_around(outline, 3 * softest)  # three standard deviations of the blur
        pixels = self.pixels[window.find_area(self.window)]
        mask = _mask(window, outline, blur)
        paint: Pixels = np.broadcast_to(np.array(colour, dtype=np.float32), (*mask.shape, 3))
        for shade in shades:
            if isinstance(shade, Rim):
                strength = shade.strength * (1 - _mask(window, outline, shade.radius))
            else:
                x = (window.list_columns() - shade.x) / shade.radius_x
                y = (window.list_rows() - shade.y) / shade.radius_y
                strength = np.asarray(shade.strength * np.exp(-(x[None, :] ** 2) - y[:, None] ** 2), dtype=np.float32)
            paint = paint + strength[..., None] * (np.array(shade.colour, dtype=np.float32) - paint)
        if within is not None:
            mask = mask * _mask(window, within)
        cover = (opacity * mask)[..., None]
        pixels[..., :3] += cover * (paint - pixels[..., :3])
        pixels[..., 3:] += cover * (1 - pixels[..., 3:])

    def paint_contour(self, outline: Points, width: float, colour: Colour) -> None:
        """Paint a line of even width along a closed outline; nothing where the width is 0."""
        if width > 0:
            closed = np.vstack([outline[-1:], outline, outline[:2]])
            along = (np.gradient(closed, axis=0))[1:-1]
            normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(np.hypot(*along.T), 1e-9)[:, None]
            line = closed[1:-1]
            self.fill(np.vstack([line + width / 2 * normal, (line - width / 2 * normal)[::-1]]), colour)

    def cut(self, outline: Points) -> None:
        """Make the inside of an outline transparent."""
        self.pixels *= 1 - _mask(self.window, outline)[..., None]


def _mask(window: Window, outline: Points, blur: float = 0) -> Pixels:
    """Return the share of every pixel that is inside the outline, 0..1 [shape=(h, w)]."""
    from PIL import Image, ImageDraw, ImageFilter

    points = outline * window.view.scale + window.view.origin - (window.x0, window.y0)
    large = Image.new("L", ((window.x1 - window.x0) * SUPERSAMPLING, (window.y1 - window.y0) * SUPERSAMPLING))
    ImageDraw.Draw(large).polygon([tuple(p) for p in (points * SUPERSAMPLING - 0.5).tolist()], fill=255)
    image = large.reduce(SUPERSAMPLING)
    if blur:
        image = image.filter(ImageFilter.GaussianBlur(blur * window.view.scale))
    return np.asarray(image, dtype=np.float32) / 255


def lay_over(above: Pixels, below: Pixels) -> NDArray[np.float32]:
    """Return premultiplied pixels laid over others [each shape=(h, w, 4)]."""
    return np.asarray(above + (1 - above[..., 3:]) * below, np.float32)
