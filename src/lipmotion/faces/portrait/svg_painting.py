"""Pixels of the shapes of a drawing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.portrait.svg_document import Shape

Pixels = NDArray[np.float32]
"""Premultiplied colour 0..255 and cover 0..1 [shape=(H, W, 4)]."""
Lines = Sequence[tuple[NDArray[np.float64], bool]]
"""Points in pixels [shape=(N, 2)], and whether each line returns to its beginning."""
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
            _lay(layer, lines, partial(_filled, even_odd=shape.even_odd), shape.fill, shape.opacities[0])
        if shape.stroke is not None and shape.opacities[1] > 0 and shape.width > 0:
            thickness = min(shape.width * scale, 2 * height)
            drawn = partial(_stroked, thickness=thickness)
            _lay(layer, lines, drawn, shape.stroke, shape.opacities[1], margin=thickness / 2)
    return layer


def over(above: Pixels, below: Pixels) -> Pixels:
    """Return a layer over another one."""
    return np.asarray(above + (1 - above[..., 3:]) * below, np.float32)


def _lay(
    layer: Pixels,
    lines: Lines,
    drawn: Callable[[Lines, int, int], Pixels],
    colour: tuple[int, int, int],
    opacity: float,
    margin: float = 0.0,
) -> None:
    """Paint lines on a layer, with how ``drawn`` covers a window around them that is ``margin`` pixels wider."""
    if not lines:
        return
    height, width = layer.shape[:2]
    left, top, right, bottom = _window(np.vstack([points for points, _ in lines]), margin, width, height)
    if left < right and top < bottom:
        part = layer[top:bottom, left:right]
        inside = [(points - (left, top), closed) for points, closed in lines]
        cover = opacity * drawn(inside, right - left, bottom - top)[..., None]
        part += cover * (np.array([*colour, 1], np.float32) - part)


def _window(points: NDArray[np.float64], margin: float, width: int, height: int) -> tuple[int, int, int, int]:
    """Return the whole pixels around points that are in a picture: left, top, right, bottom."""
    left, top = np.floor(points.min(axis=0) - margin - 1)
    right, bottom = np.ceil(points.max(axis=0) + margin + 1)
    return max(int(left), 0), max(int(top), 0), min(int(right), width), min(int(bottom), height)


def _filled(lines: Lines, width: int, height: int, *, even_odd: bool) -> Pixels:
    """Return the cover of the inside of subpaths, 0..1 [shape=(height, width)]."""
    from PIL import Image, ImageDraw

    winding = np.zeros((height * SUPERSAMPLING, width * SUPERSAMPLING), np.int16)
    for points, _ in lines:
        left, top, right, bottom = _window(points, 0.0, width, height)
        if len(points) > 2 and left < right and top < bottom:
            large = Image.new("L", ((right - left) * SUPERSAMPLING, (bottom - top) * SUPERSAMPLING))
            corners = ((points - (left, top)) * SUPERSAMPLING - 0.5).tolist()
            ImageDraw.Draw(large).polygon([tuple(p) for p in corners], fill=1)
            x, y = points.T
            turns = 1 if np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) >= 0 else -1
            rows, columns = (slice(a * SUPERSAMPLING, b * SUPERSAMPLING) for a, b in ((top, bottom), (left, right)))
            winding[rows, columns] += turns * np.asarray(large, np.int16)
    inside = winding % 2 != 0 if even_odd else winding != 0
    return _reduced(inside)


def _stroked(lines: Lines, width: int, height: int, *, thickness: float) -> Pixels:
    """Return the cover of lines with round ends and corners, 0..1 [shape=(height, width)]."""
    from PIL import Image, ImageDraw

    large = Image.new("L", (width * SUPERSAMPLING, height * SUPERSAMPLING))
    draw, thick = ImageDraw.Draw(large), max(1, round(thickness * SUPERSAMPLING))
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
