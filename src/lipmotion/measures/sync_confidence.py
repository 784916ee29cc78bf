"""How sure it is at which offset lips and sound agree, by vectors of a network such as SyncNet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.measures.sync_network import PICTURE_RATE_HZ

REACH = 15
"""Offsets are tried up to so many pictures either way."""


@dataclass(frozen=True)
class SyncConfidence:
    """Agreement of lips and sound.

    confidence : median of the mean distances at all offsets, less the least (LSE-C)
    distance   : mean distance of both vectors at the best offset (LSE-D)
    late_ms    : by how much the sound is late at the best offset; negative: early
    vectors    : how many were compared
    """

    confidence: float
    distance: float
    late_ms: float
    vectors: int


def sync_confidence(faces: NDArray[np.float32], sounds: NDArray[np.float32]) -> SyncConfidence:
    """Return how well vectors of faces and sounds [each shape=(T, D)] agree; what one has more is left out.

    Beyond the ends of the sound are zeros, as in the published program.
    Source: Chung & Zisserman 2016, §4; the names LSE-C and LSE-D: Prajwal et al. 2020.
    """
    count = min(len(faces), len(sounds))
    padded = np.pad(sounds[:count], ((REACH, REACH), (0, 0))).astype(np.float64)
    shifted = (padded[start : start + count] for start in range(2 * REACH + 1))
    distances = np.array([np.linalg.norm(faces[:count] - sound, axis=1).mean() for sound in shifted])
    best = int(distances.argmin())
    return SyncConfidence(
        float(np.median(distances) - distances[best]),
        float(distances[best]),
        (best - REACH) * 1000 / PICTURE_RATE_HZ,
        count,
    )
