"""Skins of glTF: the joints that vertices follow, and those of them that are bones of the head."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.rig.bones import Bone, bone_kind
from lipmotion.rig.gltf_accessors import GltfArrays
from lipmotion.rig.gltf_container import GltfDocument

Matrix = NDArray[np.float64]
Numbers = NDArray[np.int64]
MOST_GROUPS = 8
"""Most groups of four joints a vertex."""


def skin_weights(
    document: GltfDocument, arrays: GltfArrays, skin_number: Any, attributes: Mapping[str, Any], count: int
) -> tuple[Numbers, Matrix]:
    """Return the joints that every vertex follows, as rows of the skin's list, and how far [shape=(N, W), both].

    Raises InputError: the skin has no joints, or the numbers do not fit.
    """
    listed = document.item("skins", skin_number).get("joints")
    if not isinstance(listed, list) or not listed:
        raise InputError("a skin without joints; export it again")
    joints, weights = [np.zeros((count, 0), np.int64)], [np.zeros((count, 0))]
    for group in range(MOST_GROUPS):
        if f"JOINTS_{group}" not in attributes:
            break
        numbers = arrays.whole(attributes[f"JOINTS_{group}"], 4)
        shares = arrays.floats(attributes.get(f"WEIGHTS_{group}"), 4)
        if (
            len(numbers) != count
            or len(shares) != count
            or (count and not 0 <= numbers.min() <= numbers.max() < len(listed))
        ):
            raise InputError("joints of vertices that do not fit; export it again")
        joints.append(numbers)
        weights.append(shares)
    return np.concatenate(joints, axis=1), np.concatenate(weights, axis=1)


def head_bones(
    document: GltfDocument,
    skin_number: Any,
    joints: Numbers,
    weights: Matrix,
    places: Mapping[int, Matrix],
    first: int,
) -> Iterator[Bone]:
    """Yield the bones of the head that vertices follow, or whose parts they follow.

    joints, weights : as of ``skin_weights``;  first : number of the first vertex in the whole mesh
    places : the matrix of every node of the scene
    """
    listed = document.item("skins", skin_number)["joints"]
    kinds = kinds_of_nodes(document)
    nodes = document.items("nodes")
    of_joint = [kinds.get(id(nodes[n]), {}) if isinstance(n, int) and 0 <= n < len(nodes) else {} for n in listed]
    total = np.maximum(weights.sum(axis=1), 1e-6)
    for kind in sorted({kind for each in of_joint for kind in each}):
        member = np.array([kind in each for each in of_joint])
        shares = np.clip((weights * member[joints]).sum(axis=1) / total, 0, 1)
        rows = np.flatnonzero(shares > 0)
        node = next(each[kind] for each in of_joint if kind in each)
        if len(rows) and node in places:
            yield Bone(kind, places[node][:3, 3], rows + first, shares[rows])


def held_bones(kinds: Mapping[str, int], places: Mapping[int, Matrix], first: int, count: int) -> Iterator[Bone]:
    """Yield the bones that a mesh without skin hangs on; all of its vertices follow.

    kinds : the node of each kind that it hangs on;  first, count : its first vertex in the whole mesh, and how many
    """
    for kind, node in sorted(kinds.items()):
        if node in places and count:
            yield Bone(kind, places[node][:3, 3], np.arange(first, first + count), np.ones(count))


def kinds_of_nodes(document: GltfDocument) -> dict[int, dict[str, int]]:
    """Return, by the identity of each node, the bones of the head that it is or hangs on: the node of each kind."""
    nodes = document.items("nodes")
    parents: dict[int, int] = {}
    for number, node in enumerate(nodes):
        children = node.get("children")
        for child in children if isinstance(children, list) else []:
            if isinstance(child, int):
                parents[child] = number
    own = [bone_kind(node["name"]) if isinstance(node.get("name"), str) else None for node in nodes]
    found: dict[int, dict[str, int]] = {}
    for number, node in enumerate(nodes):
        kinds: dict[str, int] = {}
        above: int | None = number
        for _ in range(len(nodes)):
            if above is None:
                break
            kind = own[above]
            if kind is not None:
                kinds[kind] = above  # of several, the one nearest to the root: all of them hang on it
            above = parents.get(above)
        if kinds:
            found[id(node)] = kinds
    return found
