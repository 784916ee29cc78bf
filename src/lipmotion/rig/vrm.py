"""VRM characters: expressions as blendshapes, and the direction that they look in.

Source: the specifications of VRM 0.x (glTF extension ``VRM``) and VRM 1.0 (``VRMC_vrm``), by the VRM Consortium.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lipmotion.rig.gltf_container import GltfDocument
from lipmotion.rig.mesh import Blendshape

PRESETS = {"a": "aa", "i": "ih", "u": "ou", "e": "ee", "o": "oh", "joy": "happy", "sorrow": "sad", "fun": "relaxed"}
"""Names of presets of VRM 0.x in the words of VRM 1.0; all others are the same in both."""
FULL = 100.0
"""Weights of VRM 0.x are per cent."""

Bind = tuple[int, int, float]
"""A mesh of the document, one of its morph targets, and the weight of it."""


def looks_backwards(document: GltfDocument) -> bool:
    """Return whether the character looks along −z, as those of VRM 0.x do; all others look along +z."""
    return "VRM" in _extensions(document)


def expression_shapes(
    document: GltfDocument, targets: Mapping[tuple[int, int], str], shapes: Sequence[Blendshape]
) -> list[Blendshape]:
    """Return the expressions of a VRM as blendshapes, by the names of VRM 1.0; none for other files.

    targets : the name of each morph target, by mesh and number
    shapes  : the blendshapes of the targets; names that they have are left out
    Binds that name no target are left out, as viewers do.
    """
    by_name = {shape.name: shape for shape in shapes}
    expressions = {**_of_version_0(document), **_of_version_1(document)}
    found = []
    for name, binds in expressions.items():
        used = [(by_name[targets[bind[:2]]], bind[2]) for bind in binds if bind[:2] in targets]
        if used and name not in by_name:
            rows = np.unique(np.concatenate([shape.rows for shape, _ in used]))
            moved = np.zeros((len(rows), 3))
            for shape, weight in used:
                moved[np.searchsorted(rows, shape.rows)] += weight * shape.displacements
            found.append(Blendshape(name, rows, moved))
    return found


def _of_version_0(document: GltfDocument) -> dict[str, list[Bind]]:
    groups = _objects(_object(_object(_extensions(document), "VRM"), "blendShapeMaster").get("blendShapeGroups"))
    found = {}
    for group in groups:
        preset = str(group.get("presetName") or "").lower()
        name = PRESETS.get(preset, preset) if preset not in {"", "unknown"} else str(group.get("name") or "")
        binds = [
            _bind(each.get("mesh"), each.get("index"), each.get("weight"), FULL)
            for each in _objects(group.get("binds"))
        ]
        found[name] = [bind for bind in binds if bind is not None]
    return found


def _of_version_1(document: GltfDocument) -> dict[str, list[Bind]]:
    expressions = _object(_object(_extensions(document), "VRMC_vrm"), "expressions")
    meshes = [node.get("mesh") for node in document.items("nodes")]
    found = {}
    for kind in ("preset", "custom"):
        for name, expression in _object(expressions, kind).items():
            listed = _objects(expression.get("morphTargetBinds")) if isinstance(expression, dict) else []
            binds = []
            for each in listed:
                node = each.get("node")
                mesh = meshes[node] if isinstance(node, int) and 0 <= node < len(meshes) else None
                binds.append(_bind(mesh, each.get("index"), each.get("weight"), 1.0))
            found[str(name)] = [bind for bind in binds if bind is not None]
    return found


def _bind(mesh: Any, index: Any, weight: Any, full: float) -> Bind | None:
    if not isinstance(mesh, int) or not isinstance(index, int) or not isinstance(weight, int | float):
        return None
    return mesh, index, float(min(max(weight / full, 0.0), 1.0))


def _extensions(document: GltfDocument) -> dict[str, Any]:
    return _object(document.json, "extensions")


def _object(holder: Mapping[str, Any], name: str) -> dict[str, Any]:
    value = holder.get(name)
    return value if isinstance(value, dict) else {}


def _objects(value: Any) -> list[dict[str, Any]]:
    return [each for each in value if isinstance(each, dict)] if isinstance(value, list) else []
