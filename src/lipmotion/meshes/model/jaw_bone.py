"""A jaw that a bone moves, as a blendshape."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lipmotion.errors import InputError
from lipmotion.meshes.fitting.lip_placement import opening_shape
from lipmotion.meshes.model.bones import JAW
from lipmotion.meshes.model.mesh import Blendshape, Mesh

JAW_OPEN = "jawOpen"
WIDEST_RAD = np.radians(22.0)
"""How far a jaw turns at weight 1."""


def with_jaw(mesh: Mesh) -> Mesh:
    """Return a mesh whose mouth opens: one with a jaw bone gets the blendshape ``jawOpen``, where it has none.

    The blendshape is the movement of the jaw's vertices as the bone turns about the axis from ear to ear, on a straight
    way. A mesh that has a blendshape that opens the mouth, or no jaw bone, is returned as it is.
    """
    bone = next((bone for bone in mesh.bones if bone.kind == JAW), None)
    if bone is None or _opens(mesh):
        return mesh
    away = mesh.vertices[bone.rows] - bone.place
    cosine, sine = np.cos(WIDEST_RAD), np.sin(WIDEST_RAD)
    turned = away @ np.array([[1, 0, 0], [0, cosine, sine], [0, -sine, cosine]])
    shape = Blendshape(JAW_OPEN, bone.rows, bone.shares[:, None] * (turned - away))
    others = tuple(each for each in mesh.shapes if each.name != JAW_OPEN)
    return replace(mesh, shapes=(*others, shape))


def _opens(mesh: Mesh) -> bool:
    try:
        opening_shape(mesh)
    except InputError:
        return False
    return True
