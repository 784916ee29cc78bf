"""The colours of glTF vertices: ``COLOR_0``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.meshes.files.gltf_accessors import GltfArrays
from lipmotion.meshes.files.gltf_container import GltfDocument
from lipmotion.meshes.files.gltf_schema import COMPONENTS, WIDTHS
from lipmotion.meshes.model.mesh import OPAQUE, Material
from lipmotion.meshes.rendering.lighting import linear

Array = NDArray[np.float64]
WHITE = (1.0, 1.0, 1.0)
"""The colour of a primitive that has colours of vertices and no material."""


def vertex_tints(document: GltfDocument, arrays: GltfArrays, number: int, count: int) -> Array:
    """Return the light and the opacity by which those of a material are multiplied, 0 to 1 [shape=(N, 4)].

    number : of the accessor of ``COLOR_0``: three or four numbers, of floats or of bytes or shorts without a sign;
             whole numbers count as parts of the largest one, also where the file does not say so
    count  : of the vertices
    Raises InputError: another kind of numbers, another number of vertices, or as ``GltfArrays.floats``.
    """
    accessor = document.items("accessors")[number]
    width, kind = WIDTHS[accessor["type"]], np.dtype(COMPONENTS[accessor["componentType"]])
    if width not in {3, 4} or not (kind.kind == "f" or (kind.kind == "u" and kind.itemsize < 4)):
        raise InputError(
            f"colours of vertices are {accessor['type']!r} of {accessor['componentType']!r}, required VEC3 or VEC4 of "
            "floats, unsigned bytes or unsigned shorts; export it again"
        )
    values = arrays.floats(number, width, count)
    if kind.kind == "u" and not accessor.get("normalized"):
        values = values / np.iinfo(kind).max
    tints = np.ones((count, 4))
    tints[:, :width] = np.clip(values, 0, 1)
    return tints


def counted(tints: Array, material: Material) -> Array:
    """Return tints [shape=(N, 4)] as a material counts them: where it hides what is behind, their opacity is 1."""
    if material.alpha != OPAQUE:
        return tints
    return np.concatenate([tints[:, :3], np.ones((len(tints), 1))], axis=1)


def tinted(colours: Array, tints: Array) -> Array:
    """Return colours, sRGB, 0 to 1 [shape=(N, 3)], whose light is multiplied by tints [shape=(N, 4)]."""
    light = linear(colours) * tints[:, :3]
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
