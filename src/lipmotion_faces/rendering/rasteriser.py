"""Pictures of meshes without a graphics card: a camera, and a picture of which only the moving part is drawn again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion_faces.characters.textures import decode_srgb
from lipmotion_faces.kernels.raster import draw
from lipmotion_faces.rendering.lighting import LEVELS, WHITE, tone_table

Real = NDArray[np.float64]
Colours = NDArray[np.float32]
LARGEST_GREY = 255


@dataclass(frozen=True)
class Camera:
    """A camera on the z axis that looks along -z.

    width, height : of the picture in pixels, even
    centre        : x and y in the middle of the picture, in the unit of the vertices
    across        : height of the picture at z = 0, in the same unit
    distance      : of the camera from z = 0
    Raises InputError: a size that is odd or under 64 pixels, or a length that is not positive.
    """

    width: int = 1280
    height: int = 720
    centre: tuple[float, float] = (0.0, 0.0)
    across: float = 3.6
    distance: float = 9.0

    def __post_init__(self) -> None:
        for name, size in (("width", self.width), ("height", self.height)):
            if size < 64 or size % 2:
                raise InputError(f"the {name} is {size} pixels, required an even number of at least 64")
        if not (self.across > 0 and self.distance > 0):
            raise InputError(f"the camera sees {self.across} from {self.distance} away, required more than 0")

    def on_screen(self, places: Real) -> Real:
        """Return column and row in pixels, and depth, of places in space [shape=(V, 3)]."""
        scale = self.height / self.across * self.distance / np.maximum(self.distance - places[:, 2], 1e-6)
        column = self.width / 2 + (places[:, 0] - self.centre[0]) * scale
        row = self.height / 2 - (places[:, 1] - self.centre[1]) * scale
        return np.stack([column, row, -1 / np.maximum(self.distance - places[:, 2], 1e-6)], axis=1)

    @property
    def place(self) -> Real:
        """The place of the camera [shape=(3,)]."""
        return np.array([*self.centre, self.distance])

    def box(self, screen: Real) -> tuple[int, int, int, int] | None:
        """Return first column and row, and those behind the last, around what ``on_screen`` returned; None: outside."""
        size = self.width, self.height
        left, top = (max(0, int(edge - 2)) for edge in screen[:, :2].min(axis=0))
        right, bottom = (
            min(most, int(np.ceil(edge + 2))) for edge, most in zip(screen[:, :2].max(axis=0), size, strict=True)
        )
        return (left, top, right, bottom) if left < right and top < bottom else None


class Canvas:
    """A picture on which triangles are drawn, four samples a pixel."""

    def __init__(self, camera: Camera, background: Colours | None = None) -> None:
        self.camera = camera
        self.background = gradient(camera) if background is None else background
        self._tone = tone_table()
        level = np.clip(self.background, 0, 1) * np.float32(LEVELS - 1)
        self.empty: NDArray[np.uint8] = self._tone[level.astype(int)]
        """The picture of the background alone [shape=(H, W, 3)]."""

    def picture(
        self,
        places: Real,
        colours: Colours,
        triangles: NDArray[np.int32],
        *,
        onto: NDArray[np.uint8] | None = None,
        moving: slice = slice(None),
    ) -> NDArray[np.uint8]:
        """Return a new picture of triangles before the background [shape=(H, W, 3)].

        places    : of the vertices in space [shape=(V, 3)]
        colours   : of the vertices, as ``Lighting`` gives them [shape=(V, 3)]
        triangles : counterclockwise from outside; those that are seen from behind are not drawn [shape=(F, 3)]
        onto      : a picture to which the new one is equal outside the box of ``moving``
        moving    : rows of vertices; only the smallest box of pixels around them is drawn
        """
        screen = self.camera.on_screen(places)
        picture = (self.empty if onto is None else onto).copy()
        area = self.camera.box(screen[moving])
        if area is not None:
            draw(screen, colours, triangles, area, self.background, self._tone, picture)
        return picture

    def cut_out(self, places: Real, colours: Colours, triangles: NDArray[np.int32]) -> NDArray[np.uint8]:
        """Return triangles without background: red, green, blue and straight alpha [shape=(H, W, 4)]."""
        picture = self.picture(places, colours, triangles)
        alpha = self._coverage(places, np.ones(len(places), bool), triangles)
        return add_alpha(picture, alpha, self._tone)

    def shown(self, places: Real, marked: NDArray[np.bool_], triangles: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Return the pixels of which at least half shows marked vertices [shape=(H, W)].

        places : of the vertices in space [shape=(V, 3)];  marked : which of them [shape=(V,)]
        triangles : those that are not marked hide what is behind them [shape=(F, 3)]
        """
        return self._coverage(places, marked, triangles) > LARGEST_GREY // 2

    def _coverage(self, places: Real, marked: NDArray[np.bool_], triangles: NDArray[np.int32]) -> NDArray[np.uint8]:
        """Return which part of every pixel shows marked vertices, 0 to 255 [shape=(H, W)]."""
        size = self.camera.height, self.camera.width, 3
        light = np.repeat(marked[:, None], 3, axis=1).astype(np.float32)
        picture, area = np.zeros(size, np.uint8), (0, 0, size[1], size[0])
        tone = np.arange(256).astype(np.uint8)
        draw(self.camera.on_screen(places), light, triangles, area, np.zeros(size, np.float32), tone, picture)
        return picture[..., 0]


def add_alpha(picture: NDArray[np.uint8], alpha: NDArray[np.uint8], tone: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a picture before black [shape=(H, W, 3)] with its cover as straight alpha; the picture is changed."""
    partly = (alpha > 0) & (alpha < LARGEST_GREY)
    level = np.searchsorted(tone, picture[partly]) / (alpha[partly, None] / LARGEST_GREY)
    picture[partly] = tone[np.minimum(level, LEVELS - 1).astype(int)]
    return np.concatenate([picture, alpha[..., None]], axis=2)


def flat(camera: Camera, colour: tuple[int, int, int]) -> Colours:
    """Return a background of one colour (sRGB, 0 to 255), as parts of ``WHITE`` [shape=(H, W, 3)]."""
    level = np.searchsorted(tone_table(), np.array(colour)) / (LEVELS - 1)
    return np.broadcast_to(np.asarray(level, np.float32), (camera.height, camera.width, 3)).copy()


def gradient(
    camera: Camera,
    middle: tuple[float, float, float] = (0.86, 0.89, 0.9),
    edge: tuple[float, float, float] = (0.56, 0.65, 0.7),
) -> Colours:
    """Return a background [shape=(H, W, 3)] brighter in the middle, as parts of ``WHITE``; colours in sRGB, 0 to 1."""
    columns = (np.arange(camera.width) + 0.5 - camera.width / 2) / (0.75 * camera.height)
    rows = (np.arange(camera.height) + 0.5 - 0.42 * camera.height) / (0.75 * camera.height)
    near = np.exp(-(columns[None] ** 2) - rows[:, None] ** 2)[..., None]
    light = near * decode_srgb(middle) + (1 - near) * decode_srgb(edge)
    return np.asarray(light / WHITE, dtype=np.float32)
