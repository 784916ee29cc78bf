"""Noise reduction: what a fan, a tape or the mains add to a recording at all times is made 20 dB softer.

Sources: V. Stahl, A. Fischer, R. Bippus, "Quantile based noise estimation for spectral subtraction and Wiener
filtering", ICASSP 2000: in part of the time each band holds noise alone, also while somebody speaks. J. S. Lim, A. V.
Oppenheim, "Enhancement and bandwidth compression of noisy speech", Proceedings of the IEEE 67, 1979: the filter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.speech.features.mfcc import HOP
from lipmotion.types import SPEECH_RATE_HZ

NOISY_DB = (13.0, 17.0)
"""How far a recording's louder half is above its quietest tenth: up to the first, noise is reduced fully, from the
second on not at all. Clear recordings have 23 to 50 dB, white noise of 10 dB and a noisy office 9 to 11."""
STEADY_DB = (3.0, 6.0)
"""By so much a band's 40th percentile is above its 10th where its noise is steady, and where it is not: 1.5 in white
noise, 2 in an office, 5 to 8 in a babble of voices, which stays."""
BIAS = 1.3  # mean power of steady noise over its 20th percentile, in averages over ``AVERAGED`` bins and frames
AVERAGED = (3, 9)
SMOOTHED = (3, 5)  # over which power is averaged where it is filtered: single values are mostly chance
LEAST_REST = 5e-3  # of the power: less is not a voice, but what is left of a tone
LOWEST_GAIN = 0.1  # of hum, whose level hardly varies, less
BLOCK, MARGIN, MAX_BLOCKS = 10 * SPEECH_RATE_HZ, 10 * HOP, 12  # filtered at a time, with what is around; judged at most


def reduce_noise(samples: NDArray[np.float32], energy: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return sound at 16 kHz with its steady noise softer [shape=(N,)]; the same array where there is hardly any.

    energy : the log energy of its frames [shape=(T,)]
    """
    power = np.exp(energy, dtype=np.float64)
    quiet, middle = np.quantile(power, (0.1, 0.5))
    strength = np.interp(_to_decibels(power[power >= middle].mean(), quiet), NOISY_DB, (1, 0))
    if not strength:
        return samples
    from scipy.ndimage import uniform_filter
    from scipy.signal import ShortTimeFFT
    from scipy.signal.windows import hann

    transform = ShortTimeFFT(hann(3 * HOP, sym=False), HOP, SPEECH_RATE_HZ)
    starts = range(0, len(samples), BLOCK)
    judged = [samples[start : start + BLOCK + 3 * HOP] for start in starts[:: -(-len(starts) // MAX_BLOCKS)]]
    averages = [uniform_filter(transform.spectrogram(block)[:, 2:-2], AVERAGED, mode="nearest") for block in judged]
    low, noise, high = np.quantile(np.concatenate(averages, axis=1), (0.1, 0.2, 0.4), axis=1)[:, :, None]
    spread_db = _to_decibels(high, low)
    exponent = strength * np.interp(spread_db, STEADY_DB, (1, 0))
    lowest_gain = LOWEST_GAIN * np.clip(spread_db, 0.1, 1)
    result = np.empty_like(samples)
    for start in starts:
        first = max(start - MARGIN, 0)
        block = samples[first : start + BLOCK + MARGIN]
        spectrum = transform.stft(block)
        mean = uniform_filter(np.square(np.abs(spectrum)), SMOOTHED, mode="nearest")
        gain = np.clip(1 - BIAS * noise / np.maximum(mean, 1e-20), lowest_gain, 1) ** exponent
        result[start : start + BLOCK] = transform.istft(spectrum * gain, k1=len(block))[start - first :][:BLOCK]
    return result if np.square(result).mean() > LEAST_REST * np.square(samples).mean() else samples


def _to_decibels(power: NDArray[np.float64] | float, reference: NDArray[np.float64] | float) -> NDArray[np.float64]:
    return 10 * np.log10(np.maximum(power, 1e-20) / np.maximum(reference, 1e-20))
