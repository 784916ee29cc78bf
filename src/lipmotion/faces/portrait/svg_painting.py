"""Pixels of the shapes of a drawing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.portrait.svg_document import Shape

Pixels = NDArray[np.float32]
"""Premultiplied colour 0..255 and cover 0..1 [shape=(H, W, 4)]."""
SUPERSAMPLING = 3


def painted(
    shapes: Sequence[tuple[Shape, tuple[float, float]]], to_pixels: NDArray[np.float64], width: int, height: int
) -> Pixels:
    """Return shapes from back to front on nothing.

    shapes    : with how far each is moved to the right and down, in pixels
    to_pixels : from the units of the drawing [shape=(2, 3)]
    """
    layer = np.zeros((height, width, 4), np.float32)
    scale = float(np.sqrt(abs(np.linalg.det(to_pixels[:, :2]))))
    for shape, moved in shapes:
        lines = [
            (np.clip(line.points @ to_pixels[:, :2].T + to_pixels[:, 2] + moved, -1e5, 1e5), line.closed)
            for line in shape.lines
        ]
        if shape.fill is not None and shape.opacities[0] > 0:
            _lay(layer, _filled(lines, shape.even_odd, width, height), shape.fill, shape.opacities[0])
        if shape.stroke is not None and shape.opacities[1] > 0 and shape.width > 0:
            _lay(layer, _stroked(lines, shape.width * scale, width, height), shape.stroke, shape.opacities[1])
    return layer


def over(above: Pixels, below: Pixels) -> Pixels:
    """Return a layer over another one."""
    return np.asarray(above + (1 - above[..., 3:]) * below, np.float32)


def _lay(layer: Pixels, mask: Pixels, colour: tuple[int, int, int], opacity: float) -> None:
    cover = opacity * mask[..., None]
    layer += cover * (np.array([*colour, 1], np.float32) - layer)


def _filled(lines: Sequence[tuple[NDArray[np.float64], bool]], even_odd: bool, width: int, height: int) -> Pixels:
    """Return the cover of the inside of subpaths, 0..1 [shape=(height, width)]."""
    from PIL import Image, ImageDraw

    winding = np.zeros((height * SUPERSAMPLING, width * SUPERSAMPLING), np.int16)
    for points, _ in lines:
        if len(points) > 2:
            large = Image.new("L", winding.shape[::-1])
            ImageDraw.Draw(large).polygon([tuple(p) for p in (points * SUPERSAMPLING - 0.5).tolist()], fill=1)
            x, y = points.T
            turns = 1 if np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) >= 0 else -1
            winding += turns * np.asarray(large, np.int16)
    inside = winding % 2 != 0 if even_odd else winding != 0
    return _reduced(inside)


def _stroked(lines: Sequence[tuple[NDArray[np.float64], bool]], thickness: float, width: int, height: int) -> Pixels:
    """Return the cover of lines with round ends and corners, 0..1 [shape=(height, width)]."""
    from PIL import Image, ImageDraw

    large = Image.new("L", (width * SUPERSAMPLING, height * SUPERSAMPLING))
    draw, thick = ImageDraw.Draw(large), max(1, round(min(thickness, 2 * height) * SUPERSAMPLING))
    for points, closed in lines:
        path = np.vstack([points, points[:1]]) if closed else points
        at = [tuple(p) for p in (path * SUPERSAMPLING - 0.5).tolist()]
        draw.line(at, fill=1, width=thick)
        if thick > 2:
            for x, y in at:
                draw.ellipse([x - thick / 2, y - thick / 2, x + thick / 2, y + thick / 2], fill=1)
    return _reduced(np.asarray(large, bool))


def _reduced(mask: NDArray[np.bool_]) -> Pixels:
    height, width = mask.shape[0] // SUPERSAMPLING, mask.shape[1] // SUPERSAMPLING
    parts = mask.reshape(height, SUPERSAMPLING, width, SUPERSAMPLING)
    return np.asarray(parts.mean(axis=(1, 3)), np.float32)
