"""Acoustic features as pocketsphinx's English models were trained on."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from lipmotion.speech.features.mfcc import FFT_SIZE, checked_samples, liftered_cosine, log_mel, triangles
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ
from lipmotion.types import Audio

FILTERS = 25
LOWEST_HZ, HIGHEST_HZ = 130.0, 6800.0
CEPSTRA = 13


def general_features(audio: Audio) -> NDArray[np.float32]:
    """Return c0–c12 less their mean, Δ over ±2 frames, and Δ of Δ [shape=(T, 39)], frames as in ``mfcc``.

    Raises InputError: as ``mfcc``.
    Source: the model's own feat.params and CMU Sphinx's ``1s_c_d_dd``. Deviations: windows of 25 instead of
    25.6 ms, centred on their time; no noise removal.
    """
    cepstra = log_mel(checked_samples(audio), _filters()) @ liftered_cosine(FILTERS, 0, CEPSTRA)
    cepstra -= cepstra.mean(axis=0, dtype=np.float64).astype(np.float32)
    features = np.empty((len(cepstra), 3 * CEPSTRA), np.float32)
    features[:, :CEPSTRA] = cepstra
    padded = np.pad(cepstra, ((3, 3), (0, 0)), mode="edge")
    del cepstra

    def shifted(frames: int) -> NDArray[np.float32]:
        return padded[3 + frames : 3 + frames + len(features)]

    delta, of_delta = (features[:, start : start + CEPSTRA] for start in (CEPSTRA, 2 * CEPSTRA))
    np.subtract(shifted(2), shifted(-2), out=delta)
    np.subtract(shifted(3), shifted(-1), out=of_delta)
    of_delta -= shifted(1) - shifted(-3)
    return features


@cache
def _filters() -> NDArray[np.float32]:
    """Return triangular filters of equal area, equally spaced in mel, with corners on the bins [shape=(257, 25)]."""
    bin_hz = SPEECH_RATE_HZ / FFT_SIZE
    mel = np.linspace(2595 * np.log10(1 + LOWEST_HZ / 700), 2595 * np.log10(1 + HIGHEST_HZ / 700), FILTERS + 2)
    edges = (np.round(700 * (10 ** (mel / 2595) - 1) / bin_hz) * bin_hz).astype(np.float64)
    hertz = np.arange(FFT_SIZE // 2 + 1) * bin_hz
    return (triangles(hertz, edges) * 2 / (edges[2:] - edges[:-2])).astype(np.float32)
