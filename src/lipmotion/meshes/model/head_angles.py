"""The angles of a head as rotations, in the axes of glTF: x to the character's left, y up, z out of the face."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ANGLES = ("headYaw", "headPitch", "headRoll")
"""Channels of motion, in radians: to the character's left, up, and to its left shoulder."""
SIGNS = np.array([1.0, -1.0, -1.0])
ORDER = "YXZ"


def head_quaternions(angles: Array) -> Array:
    """Return the rotations of a head as quaternions x, y, z, w [shape=(T, 4)]; neighbours are less than half a turn
    apart.

    angles : of ``ANGLES`` [shape=(T, 3)]
    """
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_euler(ORDER, angles * SIGNS).as_quat()
    same = np.einsum("tq,tq->t", turned[1:], turned[:-1]) >= 0
    return np.asarray(turned * np.concatenate([[1.0], np.cumprod(np.where(same, 1.0, -1.0))])[:, None])


def head_angles(quaternions: Array) -> Array:
    """Return the angles of a head from rotations, as of ``head_quaternions`` [shape=(T, 3)]."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(quaternions).as_euler(ORDER) * SIGNS)
