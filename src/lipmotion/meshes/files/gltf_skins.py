"""Skins of glTF: the joints that vertices follow, where they take them at rest, and which are bones of the head."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.meshes.files.gltf_accessors import GltfArrays
from lipmotion.meshes.files.gltf_container import GltfDocument
from lipmotion.meshes.files.gltf_nodes import PlacedNode
from lipmotion.meshes.files.gltf_schema import LARGEST_NUMBER, MOST_GROUPS
from lipmotion.meshes.model.bones import Bone

Matrix = NDArray[np.float64]
Numbers = NDArray[np.int64]
LEAST_WEIGHT = 1e-6


@dataclass(frozen=True, eq=False)
class GltfSkin:
    """The joints of a skin.

    joints   : their nodes, in the order of the skin [J]
    matrices : where each takes what follows it [shape=(J, 3, 4)]
    """

    joints: tuple[PlacedNode, ...]
    matrices: Matrix


def read_skin(document: GltfDocument, number: int, arrays: GltfArrays, nodes: Mapping[int, PlacedNode]) -> GltfSkin:
    """Return a skin of a document at rest. Raises InputError: a joint is not in the scene, or matrices are missing."""
    skin = document.items("skins")[number]
    listed, inverse = skin["joints"], skin.get("inverseBindMatrices")
    count = len(listed) if inverse is None else arrays.count(inverse)
    document.budget.spend("joints", max(count, len(listed)))
    if not all(joint in nodes for joint in listed):
        raise InputError("a skin with joints that are not in the scene; export it again")
    if count < len(listed):
        raise InputError(f"{count} matrices of {len(listed)} joints; export it again")
    joints = tuple(nodes[joint] for joint in listed)
    matrices = np.array([joint.matrix for joint in joints])
    if inverse is not None:
        matrices = matrices @ arrays.floats(inverse, 16)[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)
    return GltfSkin(joints, matrices[:, :3])


def skin_weights(
    skin: GltfSkin, arrays: GltfArrays, attributes: Mapping[str, int], count: int
) -> tuple[Numbers, Matrix]:
    """Return the joints that every vertex follows, as rows of the skin's list, and how far [shape=(N, W), both].

    count : of the vertices
    Raises InputError: the numbers do not fit.
    """
    joints, weights = [np.zeros((count, 0), np.int64)], [np.zeros((count, 0))]
    for group in range(MOST_GROUPS):
        if f"JOINTS_{group}" not in attributes or f"WEIGHTS_{group}" not in attributes:
            break
        numbers = arrays.whole(attributes[f"JOINTS_{group}"], 4, count)
        if count and not 0 <= numbers.min() <= numbers.max() < len(skin.joints):
            raise InputError(f"vertices follow joint {numbers.max()} of {len(skin.joints)}; export it again")
        joints.append(numbers)
        weights.append(arrays.floats(attributes[f"WEIGHTS_{group}"], 4, count))
    return np.concatenate(joints, axis=1), np.concatenate(weights, axis=1)


def skinned_frames(skin: GltfSkin, joints: Numbers, weights: Matrix) -> tuple[Matrix, Matrix]:
    """Return how a skin at rest maps every vertex: matrices [shape=(N, 3, 3)] and shifts [shape=(N, 3)].

    joints, weights : as of ``skin_weights``
    """
    blended = np.zeros((len(weights), 3, 4))
    for column in range(weights.shape[1]):
        blended += weights[:, column, None, None] * skin.matrices[joints[:, column]]
    total = weights.sum(axis=1)
    held = total > LEAST_WEIGHT
    blended[held] /= total[held, None, None]
    blended[~held] = np.eye(4)[:3]
    if not (np.abs(blended) <= LARGEST_NUMBER).all():
        raise InputError(f"a skin takes vertices beyond ±{LARGEST_NUMBER:g}; export it again")
    return blended[:, :, :3], blended[:, :, 3]


def head_bones(
    skin: GltfSkin, joints: Numbers, weights: Matrix, nodes: Mapping[int, PlacedNode], first: int
) -> Iterator[Bone]:
    """Yield the bones of the head that vertices follow, or whose parts they follow.

    joints, weights : as of ``skin_weights``;  first : number of the first vertex in the whole mesh
    """
    total = np.maximum(weights.sum(axis=1), LEAST_WEIGHT)
    for kind in sorted({kind for joint in skin.joints for kind in joint.kinds}):
        member = np.array([kind in joint.kinds for joint in skin.joints])
        shares = np.clip((weights * member[joints]).sum(axis=1) / total, 0, 1)
        rows = np.flatnonzero(shares > 0)
        if len(rows):
            node = next(joint.kinds[kind] for joint in skin.joints if kind in joint.kinds)
            yield Bone(kind, nodes[node].matrix[:3, 3], rows + first, shares[rows])


def held_bones(node: PlacedNode, nodes: Mapping[int, PlacedNode], first: int, count: int) -> Iterator[Bone]:
    """Yield the bones that a mesh without skin hangs on; all of its vertices follow.

    first, count : its first vertex in the whole mesh, and how many
    """
    for kind, above in sorted(node.kinds.items()):
        if count:
            yield Bone(kind, nodes[above].matrix[:3, 3], np.arange(first, first + count), np.ones(count))
