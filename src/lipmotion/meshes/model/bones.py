"""Bones that move a head, which vertices follow them, and the angles of a head as rotations.

Axes are those of glTF: x to the character's left, y up, z out of the face.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

HEAD, NECK, JAW, LEFT_EYE, RIGHT_EYE = "head", "neck", "jaw", "leftEye", "rightEye"
_ENDS = {"top", "end", "nub", "tip", "target", "ctrl"}
_SIDES = {"l": LEFT_EYE, "left": LEFT_EYE, "r": RIGHT_EYE, "right": RIGHT_EYE}


@dataclass(frozen=True, eq=False)
class Bone:
    """A bone of a skeleton, or a node that other nodes hang on, and the vertices that follow it.

    kind   : ``HEAD``, ``NECK``, ``JAW``, ``LEFT_EYE`` or ``RIGHT_EYE``
    place  : where it turns about [shape=(3,)]
    rows   : the vertices that follow it or what hangs on it, ascending [shape=(N,)]
    shares : how far each follows, 0 to 1 [shape=(N,)]
    """

    kind: str
    place: NDArray[np.float64]
    rows: NDArray[np.int64]
    shares: NDArray[np.float64]


def bone_kind(name: str) -> str | None:
    """Return which bone of the head a name stands for, or None: ``mixamorig:Head``, ``J_Bip_C_Neck``, ``JawBone``.

    >>> bone_kind("J_Adj_L_FaceEye"), bone_kind("CC_Base_JawRoot"), bone_kind("HeadTop_End")
    ('leftEye', 'jaw', None)
    """
    words = [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]
    words = [re.sub(r"^mixamorig", "", word) or word for word in words]
    plain = {re.sub(r"(bone|root|joint)$", "", word) or word for word in words}
    if plain & _ENDS:
        return None
    if plain & {"eye", "eyeball"}:
        return next((_SIDES[word] for word in words if word in _SIDES), None)
    return next((kind for kind in (JAW, HEAD, NECK) if kind in plain), None)


def merge_bones(bones: Iterable[Bone]) -> tuple[Bone, ...]:
    """Return one bone of each kind: its vertices are those of all bones of this kind, its place that of the first."""
    by_kind: dict[str, list[Bone]] = {}
    for bone in bones:
        if len(bone.rows):
            by_kind.setdefault(bone.kind, []).append(bone)
    merged = []
    for kind, same in by_kind.items():
        rows, inverse = np.unique(np.concatenate([bone.rows for bone in same]), return_inverse=True)
        shares = np.zeros(len(rows))
        np.maximum.at(shares, inverse.reshape(-1), np.concatenate([bone.shares for bone in same]))
        merged.append(Bone(kind, same[0].place, rows, shares))
    return tuple(merged)


Array = NDArray[np.float64]
ANGLES = ("headYaw", "headPitch", "headRoll")
"""Channels of motion, in radians: to the character's left, up, and to its left shoulder."""
SIGNS = np.array([1.0, -1.0, -1.0])
ORDER = "YXZ"


def head_quaternions(angles: Array) -> Array:
    """Return rotations of a head as quaternions x, y, z, w [shape=(T, 4)], near their neighbours, from ``ANGLES``
    [shape=(T, 3)].
    """
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_euler(ORDER, angles * SIGNS).as_quat()
    same = np.einsum("tq,tq->t", turned[1:], turned[:-1]) >= 0
    return np.asarray(turned * np.concatenate([[1.0], np.cumprod(np.where(same, 1.0, -1.0))])[:, None])


def head_angles(quaternions: Array) -> Array:
    """Return the angles of a head from rotations, as of ``head_quaternions`` [shape=(T, 3)]."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(quaternions).as_euler(ORDER) * SIGNS)
