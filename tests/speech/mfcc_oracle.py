"""The plain twin of ``features.mfcc``, in double precision, written from the project's conventions.

16 kHz, 25 ms Hamming, pre-emphasis 0.97, 512-point FFT, 26 mel filters from 0 to 8 kHz, orthonormal DCT, lifter 22,
c1–c12 and log energy; Δ and ΔΔ by regression over ±2 frames; mean and variance normalised over the recording; frame n
centred at n · 10 ms, the signal reflected at both ends; powers at most 80 dB below the loudest of the recording.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

Array = NDArray[np.float64]


def features(samples: Array) -> Array:
    """Return 39 features a frame [shape=(T, 39)]."""
    frames = range(math.floor(len(samples) / 16_000 * 100 + 1e-9) + 1)
    windows = np.array([[sample(samples, i) for i in range(160 * n - 201, 160 * n + 200)] for n in frames])
    emphasised = windows[:, 1:] - 0.97 * windows[:, :-1]
    powers = np.abs(np.fft.rfft(emphasised * np.hamming(400), 512)) ** 2 @ triangles()
    cepstra = dct(np.log(np.maximum(powers, 1e-8 * powers.max())), norm="ortho")[:, 1:13]
    energies = (windows[:, 1:] ** 2).sum(axis=1)
    static = np.empty((len(frames), 13))
    static[:, :12] = cepstra * (1 + 11 * np.sin(np.pi * np.arange(1, 13) / 22))
    static[:, 12] = np.log(np.maximum(energies, 1e-8 * energies.max()))
    table = np.concatenate([static, slopes(static), slopes(slopes(static))], axis=1)
    return (table - table.mean(axis=0)) / table.std(axis=0)


def sample(samples: Array, i: int) -> float:
    """Return sample ``i`` of the signal reflected at both ends (the end itself is not repeated)."""
    last = len(samples) - 1
    return float(samples[last - abs(last - abs(i))])


def triangles() -> Array:
    """Return what each of 26 filters, evenly spaced in mel from 0 to 8 kHz, lets through of each bin."""
    mels = 2595 * np.log10(1 + np.arange(257) * 16_000 / 512 / 700)
    step = mels[-1] / 27
    return np.array([np.interp(mels / step, [n, n + 1, n + 2], [0, 1, 0]) for n in range(26)]).T


def slopes(table: Array) -> Array:
    """Return the slope of the regression line through five frames; the first and last frames repeat."""
    padded = np.pad(table, ((2, 2), (0, 0)), "edge")
    return np.array([np.polyfit(np.arange(-2, 3), padded[n : n + 5], 1)[0] for n in range(len(table))])
