"""Sampled sound."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Audio:
    """One channel of sound.

    samples : float32 array [shape=(N,)], full scale is ±1
    rate_hz : samples per second; speech is processed at 16,000

    >>> import numpy as np
    >>> Audio(np.zeros(8_000, np.float32), 16_000).duration_s
    0.5
    """

    samples: NDArray[np.float32]
    rate_hz: int

    @property
    def duration_s(self) -> float:
        """Duration in seconds."""
        return len(self.samples) / self.rate_hz
