"""The modulation spectrum: how much of the movement of a curve is at which frequency.

Source: Takamichi, Toda, Black, Neubig, Sakti & Nakamura 2016, who compute it over whole utterances.  Deviation: mean
over windows, so that clips of different lengths have one spectrum.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
WINDOW_S = 1.28
"""Length of a window; the windows overlap by half."""


def window_frames(rate_hz: float) -> int:
    """Return the number of frames of a window, an even number, at least 4."""
    return max(2 * round(WINDOW_S * rate_hz / 2), 4)


def measure_modulation_spectrum(clips: Sequence[Array], rate_hz: float) -> tuple[Array, Array]:
    """Return frequencies in Hz [shape=(F,)] and the mean power of curves at each of them [shape=(F, P)].

    clips : curves [each shape=(T_i, P)]
    Windows are Hann windows; each one is freed of its mean, and a clip that is shorter than one has one of its own
    length. The frequency 0 is left out.
    """
    size = window_frames(rate_hz)
    powers: list[Array] = []
    for clip in clips:
        length = min(size, len(clip))
        window = np.hanning(length + 2)[1:-1, None]
        window /= np.sqrt(np.square(window).sum())
        for start in range(0, len(clip) - length + 1, size // 2):
            piece = clip[start : start + length]
            centred = (piece - (piece * window).sum(axis=0) / window.sum()) * window
            powers.append(np.square(np.abs(np.fft.rfft(centred, size, axis=0))))
    frequencies: Array = np.arange(1.0, size // 2 + 1) * (rate_hz / size)
    mean: Array = np.mean(powers, axis=0)
    return frequencies, mean[1:]
