"""A character from its files, ready to be moved."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from lipmotion.errors import InputError
from lipmotion.meshes.fitting.driven import DrivenCharacter
from lipmotion.meshes.fitting.lip_placement import (
    find_opening_shape,
    part_named_lips,
    place_lips_by_points,
    place_lips_by_shape,
)
from lipmotion.meshes.model.binding import bind, paint_weights
from lipmotion.meshes.model.face_shapes import find_face_shapes
from lipmotion.meshes.model.mesh import JAW, Blendshape, Mesh
from lipmotion.meshes.model.rig_tables import read_character_table, with_sources
from lipmotion.meshes.model.surface import build_surface
from lipmotion_faces.characters.binding_files import BINDING_SUFFIX, load_binding, read_points, read_weights
from lipmotion_faces.characters.character_files import read_character

JAW_OPEN = "jawOpen"
WIDEST_RAD = np.radians(22.0)
"""How far a jaw turns at weight 1."""


def with_jaw(mesh: Mesh) -> Mesh:
    """Return a mesh whose mouth opens: one with a jaw bone gets the blendshape ``jawOpen``, where it has none.

    The blendshape is the movement of the jaw's vertices as the bone turns about the axis from ear to ear, on a straight
    way. A mesh that has a blendshape that opens the mouth, or no jaw bone, is returned as it is.
    """
    bone = next((bone for bone in mesh.bones if bone.kind == JAW), None)
    if bone is None:
        return mesh
    try:
        find_opening_shape(mesh)
    except InputError:
        away = mesh.vertices[bone.rows] - bone.place
        cosine, sine = np.cos(WIDEST_RAD), np.sin(WIDEST_RAD)
        turned = away @ np.array([[1, 0, 0], [0, cosine, sine], [0, -sine, cosine]])
        shape = Blendshape(JAW_OPEN, bone.rows, bone.shares[:, None] * (turned - away))
        return replace(mesh, shapes=(*(each for each in mesh.shapes if each.name != JAW_OPEN), shape))
    return mesh


def load_character(
    path: str | Path, *, points: Path | None = None, binding: Path | None = None, by_points: bool = False
) -> DrivenCharacter:
    """Return a character from its files, ready to be moved; with the table beside it, if there is one.

    path      : ``.glb``, ``.gltf``, ``.vrm``, ``.obj``, or a folder of OBJ files
    points    : a table of the vertices of lip points; None: they are found by the blendshape that opens the mouth
    binding   : a binding file, or a table of painted weights (``.csv``); both mean control points
    by_points : move it by control points, though it has blendshapes
    Raises InputError: a file is damaged, or what moves the mouth is not found in it.
    Raises ModelFormatError: the binding is damaged.
    """
    path, mesh = Path(path), with_jaw(read_character(path))
    table = read_character_table(path, mesh)
    mesh = with_sources(mesh, table)
    try:
        if binding is not None and binding.suffix.lower() == BINDING_SUFFIX:
            stored = load_binding(binding, mesh)
            return DrivenCharacter(mesh, stored.placement, None, stored, path, table)
        if points is not None:
            named = read_points(points)
            surface = part_named_lips(mesh, named)
            placement = place_lips_by_points(mesh, surface, named)
        else:
            surface = build_surface(mesh)
            placement = place_lips_by_shape(mesh, surface)
        if mesh.shapes and not by_points and binding is None:
            return DrivenCharacter(mesh, placement, find_face_shapes(mesh, placement), None, path, table)
        bound = bind(mesh, surface, placement)
        if binding is not None:
            bound = paint_weights(bound, mesh, read_weights(binding))
        return DrivenCharacter(mesh, placement, None, bound, path, table)
    except InputError as error:
        text = str(error)
        raise InputError(text if str(path) in text else f"{path}: {text}") from error
