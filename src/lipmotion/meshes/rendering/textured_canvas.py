"""Pictures of surfaces with textures, without a graphics card."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.pixels.textured import TexturedTriangles, draw_textured
from lipmotion.meshes.rendering.lighting import LEVELS, tone_table
from lipmotion.meshes.rendering.rasteriser import Camera, Canvas, Colours, flat

Real = NDArray[np.float64]
Picture = NDArray[np.uint8]


class TexturedCanvas:
    """A picture on which triangles with textures are drawn, four samples a pixel.

    background : light in every pixel, as parts of ``WHITE`` [shape=(H, W, 3)]; None: a soft grey gradient
    """

    def __init__(self, camera: Camera, surface: TexturedTriangles, background: Colours | None = None) -> None:
        self.camera, self.surface = camera, surface
        canvas = Canvas(camera, background)
        self._background, self.empty = canvas.background, canvas.empty
        self._black = flat(camera, (0, 0, 0))
        self._tone = tone_table()

    def picture(
        self, places: Real, light: Colours, shine: Colours, *, onto: Picture | None = None, moving: Real | None = None
    ) -> Picture:
        """Return a new picture of the surface before the background [shape=(H, W, 3)].

        places : of the vertices in space [shape=(V, 3)]
        light  : of the vertices, what a white surface sends to the viewer; shine : highlights [shape=(V, 3), both]
        onto   : a picture to which the new one is equal outside the box of ``moving``
        moving : places of vertices; only the smallest box of pixels around them is drawn
        """
        picture = (self.empty if onto is None else onto).copy()
        opacity = np.empty(picture.shape[:2], np.uint8)
        points = self.camera.on_screen(places)
        area = self.camera.box(points if moving is None else self.camera.on_screen(moving))
        if area is not None:
            draw_textured(points, light, shine, self.surface, area, self._background, self._tone, picture, opacity)
        return picture

    def cut_out(self, places: Real, light: Colours, shine: Colours) -> Picture:
        """Return the surface without background: red, green, blue and straight alpha [shape=(H, W, 4)]."""
        picture = np.zeros((self.camera.height, self.camera.width, 3), np.uint8)
        opacity = np.zeros(picture.shape[:2], np.uint8)
        points = self.camera.on_screen(places)
        area = self.camera.box(points)
        if area is not None:
            draw_textured(points, light, shine, self.surface, area, self._black, self._tone, picture, opacity)
        partly = (opacity > 0) & (opacity < 255)
        level = np.searchsorted(self._tone, picture[partly]) / (opacity[partly, None] / 255)
        picture[partly] = self._tone[np.minimum(level, LEVELS - 1).astype(int)]
        return np.concatenate([picture, opacity[..., None]], axis=2)
