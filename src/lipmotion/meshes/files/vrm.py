"""VRM characters: expressions as blendshapes, and the direction that they look in.

Source: the specifications of VRM 0.x (glTF extension ``VRM``) and VRM 1.0 (``VRMC_vrm``), by the VRM Consortium.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lipmotion.meshes.files.gltf_container import GltfDocument, plain_name
from lipmotion.meshes.model.mesh import Blendshape

PRESETS = {"a": "aa", "i": "ih", "u": "ou", "e": "ee", "o": "oh", "joy": "happy", "sorrow": "sad", "fun": "relaxed"}
"""Names of presets of VRM 0.x in the words of VRM 1.0; all others are the same in both."""
FULL_WEIGHT = 100.0
"""Weights of VRM 0.x are per cent."""

Bind = tuple[int, int, float]
"""A mesh of the document, one of its morph targets, and the weight of it."""


def looks_backwards(document: GltfDocument) -> bool:
    """Return whether the character looks along −z, as those of VRM 0.x do; all others look along +z."""
    return "VRM" in document.parts.get("extensions", {})


def expression_shapes(
    document: GltfDocument, targets: Mapping[tuple[int, int], str], shapes: Sequence[Blendshape]
) -> list[Blendshape]:
    """Return the expressions of a VRM as blendshapes, by the names of VRM 1.0; none for other files.

    targets : the name of each morph target, by mesh and number
    shapes  : the blendshapes of the targets; names that they have are left out
    Binds that name no target are left out, as viewers do. Raises InputError: they move too many vertices.
    """
    by_name = {shape.name: shape for shape in shapes}
    expressions = {**_of_version_0(document), **_of_version_1(document)}
    found = []
    for name, binds in expressions.items():
        used = [(by_name[targets[bind[:2]]], bind[2]) for bind in binds if bind[:2] in targets]
        if used and name and name not in by_name:
            document.budget.spend("blendshapes", 1)
            document.budget.spend("displacements", sum(len(shape.rows) for shape, _ in used))
            rows = np.unique(np.concatenate([shape.rows for shape, _ in used]))
            moved = np.zeros((len(rows), 3))
            for shape, weight in used:
                moved[np.searchsorted(rows, shape.rows)] += weight * shape.displacements
            found.append(Blendshape(name, rows, moved))
    return found


def _of_version_0(document: GltfDocument) -> dict[str, list[Bind]]:
    vrm = document.parts.get("extensions", {}).get("VRM", {})
    found = {}
    for group in vrm.get("blendShapeMaster", {}).get("blendShapeGroups", []):
        preset = plain_name(group.get("presetName", "")).lower()
        name = PRESETS.get(preset, preset) if preset not in {"", "unknown"} else plain_name(group.get("name", ""))
        found[name] = [_bind(each["mesh"], each, FULL_WEIGHT) for each in group.get("binds", [])]
    return found


def _of_version_1(document: GltfDocument) -> dict[str, list[Bind]]:
    expressions = document.parts.get("extensions", {}).get("VRMC_vrm", {}).get("expressions", {})
    meshes = dict(enumerate(node.get("mesh", -1) for node in document.items("nodes")))
    found = {}
    for kind in ("preset", "custom"):
        for name, expression in expressions.get(kind, {}).items():
            binds = expression.get("morphTargetBinds", [])
            found[plain_name(name)] = [_bind(meshes.get(each["node"], -1), each, 1.0) for each in binds]
    return found


def _bind(mesh: int, bind: Mapping[str, float], full: float) -> Bind:
    return mesh, int(bind["index"]), min(max(bind["weight"] / full, 0.0), 1.0)
