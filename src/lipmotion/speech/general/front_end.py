"""The features that pocketsphinx's English models were trained on."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from lipmotion.speech.mfcc import FFT_SIZE, LIFTER, checked_samples, log_mel
from lipmotion.speech.read import SPEECH_RATE_HZ
from lipmotion.types import Audio

FILTERS = 25
LOWEST_HZ, HIGHEST_HZ = 130.0, 6800.0
CEPSTRA = 13


def general_features(audio: Audio) -> NDArray[np.float32]:
    """Return c0–c12 with their mean taken off, Δ over ±2 frames, and Δ of Δ [shape=(T, 39)], frames as in ``mfcc``.

    Raises InputError: as ``mfcc``.
    Source: the model's own feat.params and CMU Sphinx's ``1s_c_d_dd``. Deviations: windows of 25 instead of
    25.6 ms, centred on their time; no noise removal.
    """
    cepstra = log_mel(checked_samples(audio), _filters()) @ _cosine()
    cepstra -= cepstra.mean(axis=0)
    padded = np.pad(cepstra, ((3, 3), (0, 0)), mode="edge")

    def shifted(frames: int) -> NDArray[np.float32]:
        return padded[3 + frames : 3 + frames + len(cepstra)]

    delta = shifted(2) - shifted(-2)
    return np.concatenate([cepstra, delta, (shifted(3) - shifted(-1)) - (shifted(1) - shifted(-3))], axis=1)


@cache
def _filters() -> NDArray[np.float32]:
    """Triangles of equal area, equally spaced in mel, their corners on the spectrum's bins [shape=(257, 25)]."""
    bin_hz = SPEECH_RATE_HZ / FFT_SIZE
    mel = np.linspace(2595 * np.log10(1 + LOWEST_HZ / 700), 2595 * np.log10(1 + HIGHEST_HZ / 700), FILTERS + 2)
    edges = np.round(700 * (10 ** (mel / 2595) - 1) / bin_hz) * bin_hz
    hertz = np.arange(FFT_SIZE // 2 + 1)[:, None] * bin_hz
    rising = (hertz - edges[:-2]) / (edges[1:-1] - edges[:-2])
    falling = (edges[2:] - hertz) / (edges[2:] - edges[1:-1])
    return (np.maximum(0, np.minimum(rising, falling)) * 2 / (edges[2:] - edges[:-2])).astype(np.float32)


@cache
def _cosine() -> NDArray[np.float32]:
    """Orthonormal DCT-II, c0–c12, liftered [shape=(25, 13)]."""
    order = np.arange(CEPSTRA)
    basis = np.cos(np.pi * (np.arange(FILTERS)[:, None] + 0.5) * order / FILTERS) * np.sqrt(2 / FILTERS)
    basis[:, 0] /= np.sqrt(2)
    return (basis * (1 + LIFTER / 2 * np.sin(np.pi * order / LIFTER))).astype(np.float32)
