"""Pictures as planes of bytes, as encoders take them: layers that move, laid on them, and the whole, moved.

Planes are uint8 [shape=(3, H, W)]; opaque. A *packed* plane holds, for every pixel, the pixel itself, the one to its
right, the one below and the one below that, from the lowest byte to the highest one [dtype uint32]: so one number is
fetched for each pixel that is moved. Shifts are in pixels, at every ``STEP``-th pixel of a window from its first one on
[shape=(ceil(h / STEP) + 1, ceil(w / STEP) + 1)], and interpolated between; they are rounded down to 1/65536 of a pixel,
shares of pixels to 1/256. Beyond its edges a window goes on with its last pixels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.choice import compiled_pays
from lipmotion.kernels.pixels.painting import PIXEL_S, _whole_shifts

Bytes = NDArray[np.uint8]
Packed = NDArray[np.uint32]
Singles = NDArray[np.float32]
Floats = NDArray[np.float64]

STEP = 8


class Box(NamedTuple):
    """The pixels y0 <= y < y1, x0 <= x < x1 of planes."""

    y0: int
    x0: int
    y1: int
    x1: int

    @property
    def pixels(self) -> int:
        """Their number."""
        return (self.y1 - self.y0) * (self.x1 - self.x0)

    @property
    def area(self) -> tuple[slice, slice]:
        """The index of these pixels in a plane."""
        return slice(self.y0, self.y1), slice(self.x0, self.x1)


class StillLayers(NamedTuple):
    """Layers that do not move, around skin that does; colours of 0..255, premultiplied by the cover.

    below : what is behind the skin [shape=(3, h, w)]
    shade : is added to it where the shadow of the skin falls [shape=(3, h, w)]
    above : what is in front of the skin, its cover 0..1 last [shape=(4, h, w)]
    """

    below: Singles
    shade: Singles
    above: Singles


class EyeLayers(NamedTuple):
    """The parts of eyes; colours of 0..255, premultiplied by the cover 0..1 that comes last.

    under   : what is behind the irises [shape=(h, w, 4)]
    opening : between the lids, the share of each pixel in which the irises are seen [shape=(h, w)]
    over    : what is in front of the irises [shape=(h, w, 4)]
    iris    : the irises, looking straight ahead [shape=(h, w, 4)]
    """

    under: Singles
    opening: Singles
    over: Singles
    iris: Singles


def pack(plane: Bytes, box: Box, packed: Packed, *, mean: bool = False) -> None:
    """Fill in a box of a packed plane.

    plane, packed : [shape=(H, W)]
    mean : pack the mean of each pixel and its three neighbours, as is needed where every second pixel is taken
    """
    if compiled_pays(box.pixels * PIXEL_S):
        from lipmotion.kernels.compiled import planes

        planes.pack(plane, *box, mean, packed)
        return
    y = np.minimum(np.arange(box.y0, box.y1 + 1), len(plane) - 1)
    x = np.minimum(np.arange(box.x0, box.x1 + 1), plane.shape[1] - (2 if mean else 1))
    values = plane[np.ix_(y, x)].astype(np.uint32)
    if mean:
        lower = np.minimum(y + 1, len(plane) - 1)
        for rows, columns in ((y, x + 1), (lower, x), (lower, x + 1)):
            values += plane[np.ix_(rows, columns)]
        values = values + 2 >> 2
    rows = values[:, :-1] | values[:, 1:] << 8
    packed[box.area] = rows[:-1] | rows[1:] << 16


def warp_planes(packed: Packed, box: Box, shift_x: Floats, shift_y: Floats, target: tuple[Bytes, Bytes, Bytes]) -> None:
    """Fill a box of a picture with another one that is shifted, by a different distance everywhere.

    packed : planes of brightness and of two colours, the latter of means [shape=(3, H, W)]
    box    : of even places and sizes
    target : planes of brightness [shape=(H, W)] and of colours at half the width and height [shape=(H / 2, W / 2)]
    """
    if compiled_pays(box.pixels * PIXEL_S):
        from lipmotion.kernels.compiled import planes

        planes.warp_planes(packed, *box, shift_x, shift_y, *target)
        return
    places = _places(shift_x, shift_y, box.y1 - box.y0, box.x1 - box.x0)
    for number, (plane, here) in enumerate(zip(packed, target, strict=True)):
        every = 2 if number else 1
        mixed = _mixed(plane[box.area], tuple(part[::every, ::every] for part in places))
        y0, x0, y1, x1 = (edge // every for edge in box)
        here[y0:y1, x0:x1] = (mixed + 32768 >> 16).astype(np.uint8)


def lay_skin(
    skin: Packed, shift_x: Floats, shift_y: Floats, layers: StillLayers, y0: int, x0: int, target: Bytes
) -> None:
    """Lay skin that is shifted, by a different distance everywhere, between still layers on a box of planes.

    skin   : packed colours, premultiplied; cover, and strength of the shadow on what is behind, 0..255
             [shape=(5, h, w)]
    y0, x0 : where the box begins
    target : [shape=(3, H, W)]
    """
    height, width = skin.shape[1:]
    if compiled_pays(3 * height * width * PIXEL_S):
        from lipmotion.kernels.compiled import planes

        planes.lay_skin(skin, shift_x, shift_y, *layers, y0, x0, target)
        return
    places = _places(shift_x, shift_y, height, width)
    mixed = [_mixed(plane, places).astype(np.float32) for plane in skin]
    share, one = np.float32(1 / (255 * 65536)), np.float32(1)
    cover, shadow = mixed[3] * share, mixed[4] * share
    for channel in range(3):
        behind = layers.below[channel] + shadow * layers.shade[channel]
        behind = mixed[channel] * np.float32(1 / 65536) + (one - cover) * behind
        behind = layers.above[channel] + (one - layers.above[3]) * behind
        target[channel, y0 : y0 + height, x0 : x0 + width] = (behind + np.float32(0.5)).astype(np.uint8)


def lay_eyes(layers: EyeLayers, shift_x: float, shift_y: float, y0: int, x0: int, target: Bytes) -> None:
    """Lay eyes on a box of planes.

    shift_x, shift_y : from each pixel to the one of the irises that is seen there
    y0, x0 : where the box begins
    target : [shape=(3, H, W)]
    """
    height, width = layers.opening.shape
    if compiled_pays(height * width * PIXEL_S):
        from lipmotion.kernels.compiled import planes

        planes.lay_eyes(*layers, np.float32(shift_x), np.float32(shift_y), y0, x0, target)
        return
    y = np.clip(np.arange(height, dtype=np.float32) + np.float32(shift_y), 0, height - 1).astype(np.float32)
    x = np.clip(np.arange(width, dtype=np.float32) + np.float32(shift_x), 0, width - 1).astype(np.float32)
    r, c = np.minimum(y.astype(int), height - 2), np.minimum(x.astype(int), width - 2)
    fy, fx = (y - r.astype(np.float32))[:, None, None], (x - c.astype(np.float32))[:, None]
    rows = [line[:, c] + fx * (line[:, c + 1] - line[:, c]) for line in (layers.iris[r], layers.iris[r + 1])]
    iris = (rows[0] + fy * (rows[1] - rows[0])) * layers.opening[..., None]
    eye = iris + (np.float32(1) - iris[..., 3:]) * layers.under
    lids = np.float32(1) - layers.over[..., 3:]
    picture = layers.over + lids * eye
    area = slice(y0, y0 + height), slice(x0, x0 + width)
    seen = (layers.over[..., 3] > 0) | (layers.under[..., 3] > 0)
    for channel in range(3):
        plane = target[channel][area]
        mixed = picture[..., channel] + (np.float32(1) - picture[..., 3]) * plane.astype(np.float32)
        plane[seen] = (mixed + np.float32(0.5)).astype(np.uint8)[seen]


def to_layer(planes: Bytes, y0: int, x0: int, layer: Singles) -> None:
    """Copy a box of planes to an opaque layer [shape=(h, w, 4)], as ``kernels.pixels.painting`` paints on."""
    if compiled_pays(layer.size / 4 * PIXEL_S / 4):
        from lipmotion.kernels.compiled import planes as compiled

        compiled.to_layer(planes, y0, x0, layer)
        return
    height, width = layer.shape[:2]
    layer[..., :3] = planes[:, y0 : y0 + height, x0 : x0 + width].transpose(1, 2, 0)
    layer[..., 3] = 1


def from_layer(layer: Singles, y0: int, x0: int, planes: Bytes) -> None:
    """Copy an opaque layer [shape=(h, w, 4)] to a box of planes, rounded."""
    if compiled_pays(layer.size / 4 * PIXEL_S / 4):
        from lipmotion.kernels.compiled import planes as compiled

        compiled.from_layer(layer, y0, x0, planes)
        return
    height, width = layer.shape[:2]
    rounded = (layer[..., :3] + np.float32(0.5)).astype(np.uint8)
    planes[:, y0 : y0 + height, x0 : x0 + width] = rounded.transpose(2, 0, 1)


_Places = tuple[NDArray[np.int64], ...]


def _places(shift_x: Floats, shift_y: Floats, height: int, width: int) -> _Places:
    """Return the row and column of each pixel's source, and 1/256 of the ways to the next row and column."""
    x = _whole_shifts(shift_x, STEP, height, width) + (np.arange(width) << 16)
    y = _whole_shifts(shift_y, STEP, height, width) + (np.arange(height)[:, None] << 16)
    x, y = (np.clip(at, 0, ((size - 1) << 16) - 1) for at, size in ((x, width), (y, height)))
    return y >> 16, x >> 16, y >> 8 & 255, x >> 8 & 255


def _mixed(packed: Packed, places: _Places) -> NDArray[np.int64]:
    """Return the pixels at places, times 65536."""
    y, x, share_y, share_x = places
    four = packed[y, x].astype(np.int64)
    upper = (four & 255) * (256 - share_x) + (four >> 8 & 255) * share_x
    lower = (four >> 16 & 255) * (256 - share_x) + (four >> 24) * share_x
    return np.asarray(upper * (256 - share_y) + lower * share_y)
