"""Cepstra as SyncNet was trained on them: frames that start at their time, neither centred nor normalised."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from lipmotion.speech.features.mfcc import (
    CEPSTRA,
    FFT_SIZE,
    FILTERS,
    HOP,
    PRE_EMPHASIS,
    WINDOW,
    checked_samples,
    liftered_cosine,
    mel,
    triangles,
)
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ
from lipmotion.types import Audio, sixteen_bits

Array = NDArray[np.float64]
FLOOR = float(np.finfo(np.float64).eps)
"""Energies of 0 become this."""


def framed_cepstra(audio: Audio) -> NDArray[np.float32]:
    """Return the log energy and c1–c12 of every frame [shape=(T, 13)], 100 frames a second.

    Samples are of 16 bits, frames of 25 ms without a window, the last one filled with zeros; edges of filters are
    rounded down to bins of the spectrum.
    Raises InputError: as ``mfcc``.
    Source: Chung & Zisserman 2016, §2.1; the front end of the published program (python_speech_features 0.6).
    """
    samples = sixteen_bits(checked_samples(audio)).astype(np.float64)
    emphasised = np.append(samples[:1], samples[1:] - PRE_EMPHASIS * samples[:-1])
    count = 1 + -(-max(len(samples) - WINDOW, 0) // HOP)
    padded = np.pad(emphasised, (0, (count - 1) * HOP + WINDOW - len(samples)))
    frames = sliding_window_view(padded, WINDOW)[::HOP]
    power = np.square(np.abs(np.fft.rfft(frames, FFT_SIZE))) / FFT_SIZE
    cepstra = _log(power @ _filters()) @ liftered_cosine(FILTERS, 1, CEPSTRA + 1)
    return np.column_stack([_log(power.sum(axis=1)), cepstra]).astype(np.float32)


def _log(values: Array) -> Array:
    return np.log(np.where(values == 0, FLOOR, values))


@cache
def _filters() -> Array:
    """Return the triangular filters [shape=(257, 26)]."""
    top = float(mel(np.array(SPEECH_RATE_HZ / 2)))
    hertz = 700 * np.expm1(np.linspace(0, top, FILTERS + 2) / 1127)
    edges = np.floor((FFT_SIZE + 1) * hertz / SPEECH_RATE_HZ)
    return triangles(np.arange(FFT_SIZE / 2 + 1), edges)
