"""The table beside a character: which curve moves each of its blendshapes, with gain and offset.

It is the table of a rig (``rig_tables``) whose controls are the blendshapes, one row each.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from lipmotion.errors import InputError, shortened
from lipmotion.meshes.files.rig_tables import RigRow, nearest, read_rig_table
from lipmotion.meshes.model.mesh import Mesh
from lipmotion.meshes.model.other_shapes import CLOSED
from lipmotion.meshes.model.shape_names import ARKIT_52, VISEMES_15, VRM_EMOTIONS, VRM_VOWELS
from lipmotion.storage.sources import is_file

TABLE_SUFFIX = ".character.csv"
SOURCES = (*ARKIT_52, *(f"viseme_{name}" for name in VISEMES_15), *VRM_VOWELS, CLOSED, *VRM_EMOTIONS)
"""The curves that blendshapes of a character may follow; besides, each what its own shape fits best: its own name."""
CLOSED_VISEME = "viseme_PP"


def table_path(character: Path) -> Path:
    """Return where the table of a character is: ``head.glb`` has ``head.glb.character.csv`` in the same folder."""
    named = character.resolve() if character.name in {"", ".."} else character
    return named.parent / f"{named.name}{TABLE_SUFFIX}"


def read_character_table(character: Path, mesh: Mesh) -> dict[str, RigRow]:
    """Return the rows of the table beside a character by its blendshapes; without limits: 0 to 1. None: no table.

    Raises InputError: a damaged table, no such blendshape or curve, or a blendshape that occurs twice.
    """
    path = table_path(character)
    if not is_file(path):
        return {}
    found: dict[str, RigRow] = {}
    for row in read_rig_table(path):
        control, source = shortened(row.control), shortened(row.source)
        if row.control not in mesh.shape_names:
            raise InputError(f"{path}: there is no blendshape {control!r}; {nearest(row.control, mesh.shape_names)}")
        if row.source not in {"", row.control, *SOURCES}:
            raise InputError(
                f"{path}: {control!r} follows {source!r}, which is no curve; {nearest(row.source, SOURCES)}"
            )
        if row.control in found:
            raise InputError(f"{path}: the blendshape {control!r} occurs twice; leave one row")
        found[row.control] = replace(row, low=max(row.low, 0.0), high=min(row.high, 1.0))
    return found


def with_sources(mesh: Mesh, table: Mapping[str, RigRow]) -> Mesh:
    """Return a mesh whose blendshapes follow the curves of a table; those without a row, what their names say."""
    shapes = [
        replace(shape, source=CLOSED_VISEME if table[shape.name].source == CLOSED else table[shape.name].source)
        if shape.name in table
        else shape
        for shape in mesh.shapes
    ]
    return replace(mesh, shapes=tuple(shapes))
