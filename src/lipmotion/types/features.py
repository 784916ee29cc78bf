"""Speech features on the 100 Hz grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FRAME_RATE_HZ = 100.0
"""Frame n of every model is centred at n / FRAME_RATE_HZ seconds."""


@dataclass(frozen=True, eq=False)
class Features:
    """Acoustic features, one row a frame, frame n centred at ``n / FRAME_RATE_HZ`` seconds.

    values     : float32 array [shape=(T, 39)], normalised per recording
    duration_s : length of the recording; T = floor(duration_s * 100) + 1
    """

    values: NDArray[np.float32]
    duration_s: float


def frame_of(time_s: float, frames: int, rate_hz: float) -> int | None:
    """Return the frame nearest to a time, or None where the recording has none."""
    frame = np.floor(time_s * rate_hz + 0.5)
    return int(frame) if 0 <= frame < frames else None
