"""Rotations of a head."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def turned(yaw: float, pitch: float, roll: float = 0.0) -> NDArray[np.float64]:
    """Return the rotation to the character's left, upwards and to the left shoulder, in radians [shape=(3, 3)]."""
    (cy, sy), (cp, sp), (cr, sr) = ((np.cos(a), np.sin(a)) for a in (yaw, pitch, roll))
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_x = np.array([[1, 0, 0], [0, cp, sp], [0, -sp, cp]])
    about_z = np.array([[cr, sr, 0], [-sr, cr, 0], [0, 0, 1]])
    return np.asarray(about_y @ about_x @ about_z)
