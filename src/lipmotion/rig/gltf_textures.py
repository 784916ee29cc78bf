"""The look of glTF materials: their colours, and the colours of their textures at the vertices."""

from __future__ import annotations

import io
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.rig.gltf_accessors import GltfArrays
from lipmotion.rig.gltf_container import GltfDocument
from lipmotion.rig.mesh import Material

Colours = NDArray[np.float64]

LARGEST_TEXTURE = 1 << 26
"""Most pixels of a texture; a larger one is not looked at."""
PICTURES = ("PNG", "JPEG", "WEBP")
SMOOTHED = 512
"""Textures are reduced to this many pixels across: a vertex then has the mean colour around it."""
OPAQUE = "OPAQUE"
_EXTENSIONS = ("EXT_texture_webp",)


def gltf_material(document: GltfDocument, number: Any) -> Material:
    """Return a material: its base colour as sRGB, its gloss from its roughness. Raises InputError: there is none."""
    if number is None:
        return Material()
    found = document.item("materials", number)
    look = _object(found.get("pbrMetallicRoughness"))
    factor = np.clip(_numbers(look.get("baseColorFactor"), 4, 1.0), 0, 1)
    linear = factor[:3]
    coded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    red, green, blue = np.clip(coded, 0, 1).tolist()
    roughness = float(np.clip(_numbers([look.get("roughnessFactor", 1.0)], 1, 1.0)[0], 0, 1))
    opacity = 1.0 if found.get("alphaMode", OPAQUE) == OPAQUE else float(factor[3])
    name = found.get("name")
    return Material(" ".join(name.split()) if isinstance(name, str) else "", (red, green, blue), 1 - roughness, opacity)


def texture_colours(document: GltfDocument, arrays: GltfArrays, material: Any, uv: Colours) -> Colours | None:
    """Return what a material's base texture shows at some places, times its base colour [shape=(N, 4)].

    uv : places in the texture, v downwards, repeated beyond 0 to 1 [shape=(N, 2)]
    Red, green and blue as sRGB; the last is the opacity, 1 in materials that are opaque whatever their texture says.
    None: there is no texture, or none that can be read (PNG, JPEG and WebP can).
    """
    picture = _picture(document, arrays, material)
    if picture is None:
        return None
    height, width = picture.shape[:2]
    at = uv % 1.0 * (width, height)
    column = np.minimum(at[:, 0].astype(int), width - 1)
    row = np.minimum(at[:, 1].astype(int), height - 1)
    look = gltf_material(document, material)
    colours: Colours = picture[row, column] / 255.0 * (*look.colour, look.opacity)
    if document.item("materials", material).get("alphaMode", OPAQUE) == OPAQUE:
        colours[:, 3] = 1.0
    return colours


def _picture(document: GltfDocument, arrays: GltfArrays, material: Any) -> NDArray[np.uint8] | None:
    if material is None:
        return None
    look = _object(document.item("materials", material).get("pbrMetallicRoughness"))
    number = _object(look.get("baseColorTexture")).get("index")
    if number is None:
        return None
    texture = document.item("textures", number)
    extensions = _object(texture.get("extensions"))
    sources = [_object(extensions.get(name)).get("source") for name in _EXTENSIONS] + [texture.get("source")]
    source = next((each for each in sources if each is not None), None)
    if source is None:
        return None
    view = document.item("images", source).get("bufferView")
    return _decoded(arrays.bytes_of(view)) if view is not None else None


def _decoded(content: bytes) -> NDArray[np.uint8] | None:
    """Return a picture, reduced [shape=(H, W, 4)]; None if it is damaged, too large or of another format."""
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(io.BytesIO(content), formats=PICTURES) as picture:
                if picture.width * picture.height > LARGEST_TEXTURE:
                    return None
                picture.draft("RGB", (SMOOTHED, SMOOTHED))
                small = picture.convert("RGBA")
                small.thumbnail((SMOOTHED, SMOOTHED))
                return np.asarray(small)
    except (OSError, ValueError, SyntaxError, MemoryError, Image.DecompressionBombError):
        return None


def _object(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _numbers(value: Any, size: int, default: float) -> Colours:
    if value is None:
        return np.full(size, default)
    try:
        numbers = np.array(value, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError("a material with a colour that is no list of numbers; export it again") from error
    if numbers.shape != (size,) or not np.isfinite(numbers).all():
        raise InputError(f"a material with a colour that is no list of {size} numbers; export it again")
    return numbers
