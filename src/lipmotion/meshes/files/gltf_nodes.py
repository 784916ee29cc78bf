"""The nodes of a glTF scene: where each is, and the bones of the head that it is or hangs on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.meshes.files.gltf_container import GltfDocument
from lipmotion.meshes.files.gltf_schema import LARGEST_NUMBER
from lipmotion.meshes.model.bones import bone_kind

Matrix = NDArray[np.float64]
DEEPEST_NESTING = 256
"""Most levels of nodes."""


@dataclass(frozen=True, eq=False)
class PlacedNode:
    """A node of a scene.

    matrix : from its own frame to that of the scene [shape=(4, 4)]
    kinds  : the node of each kind of bone that it is or hangs on; of several, the one nearest to the root
    """

    matrix: Matrix
    kinds: Mapping[str, int]


def place_nodes(document: GltfDocument) -> dict[int, PlacedNode]:
    """Return the nodes of the scene by their numbers; without scenes, all that hang on a node that hangs on none.

    Raises InputError: a node is in the scene twice, too deep, or too far away.
    """
    nodes, scenes = document.items("nodes"), document.items("scenes")
    if scenes:
        roots = scenes[document.parts.get("scene", 0)].get("nodes", [])
    else:
        roots = sorted(set(range(len(nodes))).difference(*(node.get("children", []) for node in nodes)))
    waiting = [(root, PlacedNode(np.eye(4), {}), 0) for root in roots]
    placed: dict[int, PlacedNode] = {}
    while waiting:
        number, parent, depth = waiting.pop()
        node = nodes[number]
        if number in placed or depth > DEEPEST_NESTING:
            raise InputError(f"node {number} is in the scene twice, or too deep; export it again")
        matrix = parent.matrix @ _local_matrix(node)
        if not np.abs(matrix).max() <= LARGEST_NUMBER:
            raise InputError(f"node {number} is beyond ±{LARGEST_NUMBER:g}, with those that it hangs on; scale it down")
        kind = bone_kind(node.get("name", ""))
        kinds = parent.kinds if kind is None else {kind: number, **parent.kinds}
        placed[number] = PlacedNode(matrix, kinds)
        waiting += [(child, placed[number], depth + 1) for child in node.get("children", [])]
    return placed


def _local_matrix(node: dict[str, Any]) -> Matrix:
    if "matrix" in node:
        return np.array(node["matrix"]).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    matrix[:3, :3] = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    ) * node.get("scale", (1.0, 1.0, 1.0))
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix
