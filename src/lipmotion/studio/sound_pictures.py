"""Sound as it is seen: extremes of a waveform, and a spectrogram."""

from __future__ import annotations

import io
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.speech.features.mfcc import FFT_SIZE, checked_samples, log_mel, mel, triangles
from lipmotion.types import FRAME_RATE_HZ, Audio

BANDS = 64
LOWEST_HZ, HIGHEST_HZ = 100.0, 7600.0
SHOWN_DB = 60.0
"""From the loudest moment of a recording down to this many decibels below it, grey goes from white to black."""


def peaks(audio: Audio, columns: int, start_s: float, end_s: float) -> dict[str, list[float]]:
    """Return the lowest and the highest sample of each of equal parts of a sound, rounded to 0.001."""
    stop = min(round(end_s * audio.rate_hz), len(audio.samples))
    part = audio.samples[min(round(start_s * audio.rate_hz), stop - 1) : stop]
    starts = np.arange(columns) * len(part) // columns
    lowest, highest = np.minimum.reduceat(part, starts), np.maximum.reduceat(part, starts)
    return {"lowest": lowest.astype(float).round(3).tolist(), "highest": highest.astype(float).round(3).tolist()}


def log_mel_picture(audio: Audio) -> NDArray[np.uint8]:
    """Return the spectrogram of a sound at 16 kHz [shape=(BANDS, T)], 0 to 255, the lowest band last."""
    powers = log_mel(checked_samples(audio), _filters())
    decibels = (powers - powers.max(initial=-np.inf)) * (10 / np.log(10))
    return np.rint(255 * np.clip(1 + decibels / SHOWN_DB, 0, 1)).astype(np.uint8).T[::-1]


def as_png(picture: NDArray[np.uint8]) -> bytes:
    """Return a picture [shape=(H, W), or (H, W, 3)] as PNG."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(picture)).save(file, format="PNG", compress_level=3)
    return file.getvalue()


@cache
def _filters() -> NDArray[np.float32]:
    bins: NDArray[Any] = mel(np.arange(FFT_SIZE // 2 + 1) * 160 * FRAME_RATE_HZ / FFT_SIZE)
    edges = np.linspace(mel(np.array(LOWEST_HZ)), mel(np.array(HIGHEST_HZ)), BANDS + 2)
    return triangles(bins, edges).astype(np.float32)
