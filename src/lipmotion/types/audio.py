"""Sampled sound."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FULL_SCALE = 32_768
"""The 16-bit value of a sample of 1, which is one more than there is."""


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


def to_sixteen_bits(samples: NDArray[np.float32]) -> NDArray[np.int16]:
    """Return samples in 16 bits, as files hold them; what is beyond full scale is clipped."""
    return np.clip(np.rint(samples * FULL_SCALE), -FULL_SCALE, FULL_SCALE - 1).astype(np.int16)


def from_sixteen_bits(values: NDArray[np.int16]) -> NDArray[np.float32]:
    """Return the samples that 16-bit values stand for; they become the same values again."""
    return values.astype(np.float32) / np.float32(FULL_SCALE)
