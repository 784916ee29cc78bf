"""A transparent layer on which smooth shapes are painted. Used once per face; nothing here runs per frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lipmotion_faces.portrait.design import Colour
from lipmotion_faces.portrait.outlines import Points
from lipmotion_faces.portrait.view import Pixels, Window

SUPERSAMPLING = 4


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
        """Paint the inside of an outline.

        blur   : softness of the edge, eye distances
        within : another outline; nothing is painted outside it
        """
        softest = max([blur, *(shade.radius for shade in shades if isinstance(shade, Rim))])
        window = self.window.around(outline, 3 * softest)
        pixels = self.pixels[window.area_in(self.window)]
        mask = _mask(window, outline, blur)
        paint: Pixels = np.broadcast_to(np.array(colour, dtype=np.float32), (*mask.shape, 3))
        for shade in shades:
            paint = paint + _strength(window, shade, outline)[..., None] * (
                np.array(shade.colour, dtype=np.float32) - paint
            )
        if within is not None:
            mask = mask * _mask(window, within)
        cover = (opacity * mask)[..., None]
        pixels[..., :3] += cover * (paint - pixels[..., :3])
        pixels[..., 3:] += cover * (1 - pixels[..., 3:])

    def contour(self, outline: Points, width: float, colour: Colour) -> None:
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


def _strength(window: Window, shade: Glow | Rim, outline: Points) -> Pixels:
    """Return the weight of a shade in every pixel, 0..1 [shape=(h, w)]."""
    if isinstance(shade, Rim):
        return shade.strength * (1 - _mask(window, outline, shade.radius))
    x = (window.columns() - shade.x) / shade.radius_x
    y = (window.rows() - shade.y) / shade.radius_y
    return np.asarray(shade.strength * np.exp(-(x[None, :] ** 2) - y[:, None] ** 2), dtype=np.float32)


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
