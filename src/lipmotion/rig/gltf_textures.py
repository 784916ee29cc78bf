"""The look of glTF materials: their colours and their textures."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.rig.gltf_accessors import GltfArrays
from lipmotion.rig.gltf_container import GltfDocument
from lipmotion.rig.mesh import BLEND, MASK, OPAQUE, Material
from lipmotion.rig.textures import Texture, read_texture

Colours = NDArray[np.float64]

UNKNOWN = (0.8, 0.72, 0.66)
"""The colour (sRGB) of a material whose texture cannot be read: a pale skin, rather than the white that is usually
multiplied by the texture."""
_EXTENSIONS = ("EXT_texture_webp",)
_TRANSFORM = "KHR_texture_transform"


class GltfMaterials:
    """The materials of a document; every texture is read once."""

    def __init__(self, document: GltfDocument, arrays: GltfArrays) -> None:
        self._document, self._arrays = document, arrays
        self._textures: dict[int, Texture | None] = {}
        self._materials: dict[int, Material] = {}

    def material(self, number: Any) -> Material:
        """Return a material: its base colour as sRGB, its texture, its gloss from its roughness.

        number : of the document; None: the default material
        A texture that cannot be read gives a warning and the colour ``UNKNOWN``.
        Raises InputError: there is none of this number, or it has values of a wrong kind.
        """
        if number is None:
            return Material()
        found = self._document.item("materials", number)
        if number not in self._materials:
            self._materials[number] = self._read(found)
        return self._materials[number]

    def moved(self, number: Any, uv: Colours) -> Colours:
        """Return places in a material's texture as its extension ``KHR_texture_transform`` moves them.

        uv : v downwards [shape=(N, 2)]
        """
        if number is None:
            return uv
        look = _object(self._document.item("materials", number).get("pbrMetallicRoughness"))
        how = _object(_object(_object(look.get("baseColorTexture")).get("extensions")).get(_TRANSFORM))
        if not how:
            return uv
        scale, offset = _numbers(how.get("scale"), 2, 1.0), _numbers(how.get("offset"), 2, 0.0)
        angle = float(_numbers([how.get("rotation", 0.0)], 1, 0.0)[0])
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        return (uv * scale) @ turn + offset

    def _read(self, found: dict[str, Any]) -> Material:
        look = _object(found.get("pbrMetallicRoughness"))
        factor = np.clip(_numbers(look.get("baseColorFactor"), 4, 1.0), 0, 1)
        linear = factor[:3]
        coded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        roughness = float(np.clip(_numbers([look.get("roughnessFactor", 1.0)], 1, 1.0)[0], 0, 1))
        alpha = found.get("alphaMode", OPAQUE)
        alpha = alpha if alpha in (MASK, BLEND) else OPAQUE
        texture = None
        if look.get("baseColorTexture") is not None:
            texture = self._texture(look)
            if texture is None:
                coded = np.array(UNKNOWN)
        red, green, blue = np.clip(coded, 0, 1).tolist()
        name = found.get("name")
        return Material(
            " ".join(name.split()) if isinstance(name, str) else "",
            (red, green, blue),
            1 - roughness,
            1.0 if alpha == OPAQUE else float(factor[3]),
            texture,
            alpha,
            float(np.clip(_numbers([found.get("alphaCutoff", 0.5)], 1, 0.5)[0], 0, 1)),
            found.get("doubleSided") is True,
        )

    def _texture(self, look: dict[str, Any]) -> Texture | None:
        number = _object(look.get("baseColorTexture")).get("index")
        if number is None:
            return None
        texture = self._document.item("textures", number)
        extensions = _object(texture.get("extensions"))
        sources = [_object(extensions.get(name)).get("source") for name in _EXTENSIONS] + [texture.get("source")]
        source = next((each for each in sources if each is not None), None)
        if source is None:
            _warn("is in a format (KTX2, AVIF) that is not read; export it as PNG or JPEG")
            return None
        image = self._document.item("images", source)
        if source not in self._textures:
            self._textures[source] = self._decoded(image)
        return self._textures[source]

    def _decoded(self, image: dict[str, Any]) -> Texture | None:
        view = image.get("bufferView")
        try:
            linked = view is None
            content = self._document.linked(image.get("uri"), "picture") if linked else self._arrays.bytes_of(view)
        except InputError as error:
            _warn(f"cannot be read: {error}")
            return None
        texture = read_texture(content)
        if texture is None:
            _warn("is damaged, too large, or no PNG, JPEG or WebP; export it again")
        return texture


def _warn(what: str) -> None:
    warnings.warn(f"a texture of the character {what}. Its surface has one colour", UserWarning, stacklevel=2)


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
