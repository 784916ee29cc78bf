"""The log mel spectrum of a recording, normalised: the input of acoustic networks."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from lipmotion.speech.features.mfcc import FFT_SIZE, checked_samples, log_mel, mel, triangles, warped
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ
from lipmotion.types import SPECTRUM_BANDS, Audio

LOWEST_HZ, HIGHEST_HZ = 60.0, 7600.0
DYNAMIC_RANGE_DB = 60.0
"""Powers are floored this far below the loudest of the recording: what is under the noise of most rooms is the same."""
LEAST_DEVIATION = 1e-3


def spectrum(audio: Audio, warp: float = 1.0) -> NDArray[np.float32]:
    """Return the log power in ``SPECTRUM_BANDS`` mel bands [shape=(T, 40)], frames as in ``mfcc``.

    warp : factor by which frequencies are stretched, as in ``mfcc``
    Each band has mean 0 over the recording; it is divided by the mean of its own standard deviation and that of the
    whole spectrum, so that bands without speech stay small.
    Raises InputError: as ``mfcc``.
    """
    powers = log_bands(checked_samples(audio), warp)
    powers = np.maximum(powers, powers.max() - np.float32(DYNAMIC_RANGE_DB / 10 * np.log(10)))
    powers -= powers.mean(axis=0, dtype=float).astype(np.float32)
    squares = np.square(powers).mean(axis=0, dtype=float)
    powers /= (np.sqrt(squares) / 2 + np.sqrt(squares.mean()) / 2 + LEAST_DEVIATION).astype(np.float32)
    return powers


def log_bands(samples: NDArray[np.float32], warp: float = 1.0) -> NDArray[np.float32]:
    """Return the natural log power in ``SPECTRUM_BANDS`` mel bands, not normalised [shape=(T, 40)]; as ``spectrum``."""
    return log_mel(samples, band_filters(warp))


@cache
def band_centres() -> NDArray[np.float64]:
    """Return the frequencies in Hz at which the bands of ``log_bands`` are most sensitive [shape=(40,)]."""
    hertz = np.arange(SPEECH_RATE_HZ / 2 + 1)
    return np.interp(_edges()[1:-1], mel(hertz), hertz)


def _edges() -> NDArray[np.float64]:
    """Return where the bands begin, are most sensitive, and end, in mel [shape=(42,)]."""
    return np.linspace(mel(np.array(LOWEST_HZ)), mel(np.array(HIGHEST_HZ)), SPECTRUM_BANDS + 2)


@cache
def band_filters(warp: float) -> NDArray[np.float32]:
    """Return triangular filters, equally spaced in mel, of warped frequencies [shape=(257, 40)]."""
    bins = mel(warped(np.arange(FFT_SIZE // 2 + 1) * SPEECH_RATE_HZ / FFT_SIZE, warp))
    return triangles(bins, _edges()).astype(np.float32)
