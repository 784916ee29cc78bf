"""The look of glTF materials: their colours and their textures."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.meshes.files.gltf_accessors import GltfArrays
from lipmotion.meshes.files.gltf_container import GltfDocument, plain_name
from lipmotion.meshes.model.mesh import OPAQUE, Material
from lipmotion.meshes.model.textures import Texture, read_texture

Colours = NDArray[np.float64]

UNKNOWN = (0.8, 0.72, 0.66)
"""The colour (sRGB) of a material whose texture cannot be read: a pale skin, rather than the white that is usually
multiplied by the texture."""


class GltfMaterials:
    """The materials of a document; every picture is read once."""

    def __init__(self, document: GltfDocument, arrays: GltfArrays) -> None:
        self._document, self._arrays = document, arrays
        self._textures: dict[str | int, Texture | None] = {}
        self._materials: dict[int, Material] = {}

    def material(self, number: int | None) -> Material:
        """Return a material: its base colour as sRGB, its texture, its gloss from its roughness.

        number : of the document; None: the default material
        A texture that cannot be read gives a warning and the colour ``UNKNOWN``.
        """
        if number is None:
            return Material()
        if number not in self._materials:
            self._materials[number] = self._read(self._document.items("materials")[number])
        return self._materials[number]

    def moved(self, number: int | None, uv: Colours) -> Colours:
        """Return places in a material's texture as its extension ``KHR_texture_transform`` moves them.

        uv : v downwards [shape=(N, 2)]
        """
        look = {} if number is None else self._document.items("materials")[number].get("pbrMetallicRoughness", {})
        how = look.get("baseColorTexture", {}).get("extensions", {}).get("KHR_texture_transform")
        if not how:
            return uv
        angle = how.get("rotation", 0.0)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        return (uv * how.get("scale", (1.0, 1.0))) @ turn + how.get("offset", (0.0, 0.0))

    def _read(self, found: dict[str, Any]) -> Material:
        look = found.get("pbrMetallicRoughness", {})
        factor = np.clip(look.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0)), 0, 1)
        linear = factor[:3]
        coded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        alpha = found.get("alphaMode", OPAQUE)
        texture = None
        if "baseColorTexture" in look:
            texture = self._texture(self._document.items("textures")[look["baseColorTexture"]["index"]])
            if texture is None:
                coded = np.array(UNKNOWN)
        red, green, blue = np.clip(coded, 0, 1).tolist()
        return Material(
            plain_name(found.get("name", "")),
            (red, green, blue),
            1 - min(max(look.get("roughnessFactor", 1.0), 0.0), 1.0),
            1.0 if alpha == OPAQUE else float(factor[3]),
            texture,
            alpha,
            min(max(found.get("alphaCutoff", 0.5), 0.0), 1.0),
            found.get("doubleSided", False),
        )

    def _texture(self, texture: dict[str, Any]) -> Texture | None:
        source = texture.get("extensions", {}).get("EXT_texture_webp", texture).get("source")
        if source is None:
            _warn("is in a format (KTX2, AVIF) that is not read; export it as PNG or JPEG")
            return None
        image = self._document.items("images")[source]
        place = image.get("bufferView", image.get("uri", ""))
        if place not in self._textures:
            self._textures[place] = self._picture(place)
        return self._textures[place]

    def _picture(self, place: int | str) -> Texture | None:
        try:
            if isinstance(place, str):
                content: bytes | memoryview = self._document.linked(place, "picture")
            else:
                content = self._arrays.bytes_of(place)
            self._document.budget.spend("bytes of pictures", len(content))
            texture = read_texture(content, self._document.budget)
        except InputError as error:
            _warn(f"cannot be read: {error}")
            return None
        if texture is None:
            _warn("is damaged, too large, or no PNG, JPEG or WebP; export it again")
        return texture


def _warn(what: str) -> None:
    warnings.warn(f"a texture of the character {what}. Its surface has one colour", UserWarning, stacklevel=2)
