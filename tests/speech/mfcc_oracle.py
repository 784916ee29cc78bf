"""The slow, readable twin of ``features.mfcc``: one frame, one filter, one coefficient at a time, in double precision.

Written from the project's conventions: 16 kHz, 25 ms Hamming, pre-emphasis 0.97, 512-point FFT, 26 mel filters from 0
to 8 kHz, orthonormal DCT, lifter 22, c1–c12 and log energy; Δ and ΔΔ by regression over ±2 frames; mean and variance
normalised over the recording; frame n centred at n · 10 ms, the signal reflected at both ends; powers at most 80 dB
below the loudest of the recording.
"""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def features(samples: Array) -> Array:
    """Return 39 features a frame [shape=(T, 39)]."""
    frames = range(math.floor(len(samples) / 16_000 * 100 + 1e-9) + 1)
    mel_powers = [mel_powers_of(samples, n) for n in frames]
    loudest = max(map(max, mel_powers))
    energies = [sum(sample(samples, i) ** 2 for i in window_indices(n)) for n in frames]
    static = np.array(
        [
            [
                *cepstra([math.log(max(power, 1e-8 * loudest)) for power in powers]),
                math.log(max(energy, 1e-8 * max(energies))),
            ]
            for powers, energy in zip(mel_powers, energies, strict=True)
        ]
    )
    first = slopes(static)
    table = np.concatenate([static, first, slopes(first)], axis=1)
    return np.array([(column - column.mean()) / column.std() for column in table.T]).T


def sample(samples: Array, i: int) -> float:
    """Return sample ``i`` of the signal reflected at both ends (the end itself is not repeated)."""
    last = len(samples) - 1
    i = abs(i)
    return float(samples[last - abs(last - i)])


def window_indices(n: int) -> range:
    """Return the 400 samples of frame n: from 12.5 ms before its centre to just before 12.5 ms after."""
    return range(160 * n - 200, 160 * n + 200)


def mel_powers_of(samples: Array, n: int) -> list[float]:
    """Return what each filter lets through of frame n."""
    emphasised = [sample(samples, i) - 0.97 * sample(samples, i - 1) for i in window_indices(n)]
    hamming = [0.54 - 0.46 * math.cos(2 * math.pi * k / 399) for k in range(400)]
    padded = np.zeros(512)
    padded[:400] = [value * weight for value, weight in zip(emphasised, hamming, strict=True)]
    power = np.abs(np.fft.rfft(padded)) ** 2
    return [mel_power(power, number) for number in range(26)]


def cepstra(log_mel: list[float]) -> list[float]:
    """Return c1–c12, liftered."""
    result = []
    for order in range(1, 13):
        terms = [log_mel[j] * math.cos(math.pi * order * (j + 0.5) / 26) for j in range(26)]
        result.append((1 + 11 * math.sin(math.pi * order / 22)) * math.sqrt(2 / 26) * sum(terms))
    return result


def mel(hertz: float) -> float:
    return 2595 * math.log10(1 + hertz / 700)


def mel_power(power: Array, number: int) -> float:
    """Return what one of 26 triangles, evenly spaced in mel from 0 to 8 kHz, lets through."""
    step = mel(8000) / 27
    left, centre, right = number * step, (number + 1) * step, (number + 2) * step
    total = 0.0
    for k in range(257):
        position = mel(k * 16_000 / 512)
        if left < position <= centre:
            total += power[k] * (position - left) / (centre - left)
        elif centre < position < right:
            total += power[k] * (right - position) / (right - centre)
    return total


def slopes(table: Array) -> Array:
    """Return the slope of the regression line through five frames; the first and last frames repeat."""
    frames = len(table)
    result = np.empty_like(table)
    for n in range(frames):
        five = [table[min(max(n + k, 0), frames - 1)] for k in range(-2, 3)]
        result[n] = np.polyfit(np.arange(-2, 3), np.array(five), 1)[0]
    return result
