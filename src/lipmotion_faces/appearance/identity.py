"""Whether pictures show the same person, as far as the lower half of a face tells."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.appearance.lower_face import HEIGHT, WIDTH

Floats = NDArray[np.float32]

SAME_PERSON_LIKENESS = 0.78
"""Least likeness of two recordings of one person. Between clips of one person it was 0.83 to 0.99 (four people),
between those of different people up to 0.76, and 0.83 twice in 228 pairs: GRID, and three open talkers."""
_ROWS, _COLUMNS, _STEP = 110, slice(20, 108), 3
"""Nose, cheeks and mouth, without neck and background; every third sample."""


def face_signature(pictures: NDArray[Any]) -> Floats:
    """Return what is compared of the lower faces of a recording: float32 array [shape=(N,)].

    pictures : of the lower face, in px of the face [shape=(T, 128, 128, 3)], at least one; or their mean
    """
    mean = pictures.reshape(-1, HEIGHT, WIDTH, 3).mean(axis=(0, 3), dtype=np.float64)
    part = mean[:_ROWS:_STEP, _COLUMNS][:, ::_STEP].ravel()
    centred = part - part.mean()
    return (centred / max(float(np.linalg.norm(centred)), 1e-9)).astype(np.float32)


def likeness(one: Floats, other: Floats) -> float:
    """Return the correlation of two signatures, -1 to 1; below ``SAME_PERSON_LIKENESS`` probably of two people."""
    return float(one @ other)
