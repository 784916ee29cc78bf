"""Textures: pictures that lie on surfaces, and all of them with their reductions in one table."""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.meshes.model.mesh import Texture
from lipmotion_faces.characters.file_limits import Budget

MAX_BYTES = 400_000_000  # most bytes that decoding a picture may take: a larger one is not looked at
MAX_SCANS = 100  # most passes over a JPEG; each takes as long as a picture
DIRECT = {"RGB", "L"}  # modes of pictures that are reduced as they are; all others get an opacity first
PICTURES = ("PNG", "JPEG", "WEBP")
MAX_COLUMNS = 1024  # textures are reduced to this many pixels across: a head of 720 rows shows no more
FULL_SCALE = 65535


def read_texture(content: bytes | memoryview, budget: Budget | None = None) -> Texture | None:
    """Return the texture in the bytes of a picture, reduced to ``MAX_COLUMNS`` pixels across.

    budget : counts its pixels before they are decoded; None: of this picture alone
    None: the picture is damaged, too large, or of another format than PNG, JPEG and WebP.
    Raises InputError: with those that were read before, there are too many pixels.
    """
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(io.BytesIO(content), formats=PICTURES) as picture:
                pixels = picture.width * picture.height
                picture.draft("RGB", (MAX_COLUMNS, MAX_COLUMNS))  # a JPEG is reduced as it is decoded
                direct = picture.mode in DIRECT and "transparency" not in picture.info
                coefficients = 2 * len(picture.getbands()) * pixels if "progressive" in picture.info else 0
                size = coefficients + (4 if direct else 9) * picture.width * picture.height
                scans = bytes(content).count(b"\xff\xda") if picture.format == "JPEG" else 1
                if (20 * pixels if picture.format == "WEBP" else size) > MAX_BYTES or scans > MAX_SCANS:
                    return None
                (budget or Budget()).spend("pixels of pictures", pixels)
                small = picture if direct else picture.convert("RGBA")
                small.thumbnail((MAX_COLUMNS, MAX_COLUMNS))
                return Texture(np.asarray(small.convert("RGBA")))
    except InputError:
        raise
    except (OSError, ValueError, SyntaxError, MemoryError, Image.DecompressionBombError):
        return None


@dataclass(frozen=True, eq=False)
class TextureTable:
    """Some textures, each reduced by half again and again, down to one pixel, in one array."""

    texels: NDArray[np.uint16]  # reflected light and opacity, 0 to 65535 [shape=(N, 4)]
    levels: NDArray[np.int64]  # first texel, width and height of every reduction [shape=(L, 3)]
    first: tuple[int, ...]  # the row of ``levels`` that is each texture in full; the following rows are its reductions

    def pick(self, texture: int, in_texture: NDArray[np.float64], on_screen: NDArray[np.float64]) -> NDArray[np.int32]:
        """Return the row of ``levels`` that suits triangles, by areas in texture and on screen [each shape=(F,)]."""
        first = self.first[texture]
        last = (*self.first, len(self.levels))[texture + 1] - 1
        pixels = in_texture * float(self.levels[first, 1] * self.levels[first, 2])
        halvings = 0.5 * np.log2(np.maximum(pixels, 1e-12) / np.maximum(on_screen, 1e-12))
        return (first + np.clip(np.rint(halvings), 0, last - first)).astype(np.int32)


def reduce_textures(textures: Sequence[Texture]) -> TextureTable:
    """Return textures with their reductions; each pixel of a reduction is the mean of four, weighted by opacity."""
    texels: list[NDArray[np.uint16]] = []
    levels: list[tuple[int, int, int]] = []
    first: list[int] = []
    count, reflected = 0, decode_srgb(np.arange(256) / 255).astype(np.float32)
    for texture in textures:
        first.append(len(levels))
        image = reflected[texture.pixels]
        image[..., 3] = texture.pixels[..., 3] / np.float32(255)
        while True:
            height, width = image.shape[:2]
            levels.append((count, width, height))
            texels.append(np.rint(FULL_SCALE * image).astype(np.uint16).reshape(-1, 4))
            count += height * width
            if height == width == 1:
                break
            image = _halve(image)
    if not levels:
        texels, levels = [np.full((1, 4), FULL_SCALE, np.uint16)], [(0, 1, 1)]
    return TextureTable(np.concatenate(texels), np.array(levels, np.int64), tuple(first))


def _halve(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a picture of half the height and width, at least 1 [shape=(max(H // 2, 1), max(W // 2, 1), 4)]."""
    height, width = (max(size // 2, 1) for size in image.shape[:2])
    blocks = image[: 2 * height, : 2 * width].reshape(height, -1, width, min(2, image.shape[1]), 4)
    plain, alpha = blocks.mean(axis=(1, 3)), blocks[..., 3:].sum(axis=(1, 3))
    total = (blocks[..., :3] * blocks[..., 3:]).sum(axis=(1, 3))
    plain[..., :3] = np.where(alpha > 0, np.minimum(total / np.maximum(alpha, 1e-6), 1), plain[..., :3])
    return plain


def decode_srgb(colour: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Return sRGB colours, 0 to 1, as diffuse reflection; the shape stays."""
    values = np.asarray(colour, float)
    return np.asarray(np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4))


def encode_srgb(light: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return diffuse reflection as sRGB colours, 0 to 1; the shape stays."""
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def find_opacity_range(
    texture: Texture, low: NDArray[np.float64], high: NDArray[np.float64], reach: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return least and largest opacity in boxes, v down [shape=(N, 2)], 0 to 1; those over an edge get 0 and 1."""
    size = np.array(texture.pixels.shape[1::-1])
    shift = np.floor(low)
    first = np.floor((low - shift) * size).astype(np.int64) - reach[:, None]
    last = np.ceil((high - shift) * size).astype(np.int64) + reach[:, None]
    inside = (first >= 0).all(axis=1) & (last <= size).all(axis=1)
    low_opacity, high_opacity = np.zeros(len(low)), np.ones(len(low))
    (x0, y0), (x1, y1) = first[inside].T, last[inside].T
    count = (x1 - x0) * (y1 - y0)
    for levels, result, solid in (((250, 242, 128), low_opacity, True), ((2, 13, 128), high_opacity, False)):
        for level in levels[::-1]:  # the strictest one last
            marked = texture.pixels[..., 3] >= level if solid else texture.pixels[..., 3] < level
            table = np.pad(np.cumsum(np.cumsum(marked, axis=0, dtype=np.int64), axis=1), ((1, 0), (1, 0)))
            all_of_it = table[y1, x1] - table[y0, x1] - table[y1, x0] + table[y0, x0] == count
            rows = np.flatnonzero(inside)[all_of_it]
            result[rows] = level / 255
    return low_opacity, high_opacity


def find_pixels(texture: Texture, uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the nearest pixels at places, v down, repeated beyond 0 to 1, as 0 to 1 [shapes=(N, 4), (N, 2)]."""
    height, width = texture.pixels.shape[:2]
    at = uv % 1.0 * (width, height)
    column = np.minimum(at[:, 0].astype(int), width - 1)
    row = np.minimum(at[:, 1].astype(int), height - 1)
    return np.asarray(texture.pixels[row, column] / 255.0)
