"""Lower sampling rates of sound in memory: the rate of speech, and whole shares of a rate."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ
from lipmotion.types import Audio, to_sixteen_bits

BLOCK = 1 << 16
"""Samples that are resampled at a time."""


def at_speech_rate(sound: Audio) -> Audio:
    """Return sound at 16 kHz, bit by bit what ``read_audio`` returns of a ``.wav`` or ``.flac`` with its 16 bits."""
    import av

    resampler = av.AudioResampler(format="flt", layout="mono", rate=SPEECH_RATE_HZ)
    parts: list[Any] = []
    for start in range(0, len(sound.samples), BLOCK):
        block = to_sixteen_bits(sound.samples[None, start : start + BLOCK])
        frame = av.AudioFrame.from_ndarray(block, format="s16", layout="mono")
        frame.rate, frame.pts, frame.time_base = sound.rate_hz, None, Fraction(1, sound.rate_hz)
        parts += resampler.resample(frame)
    parts += resampler.resample(None)
    return Audio(np.concatenate([part.to_ndarray()[0] for part in parts]), SPEECH_RATE_HZ)


Samples = NDArray[np.float32]

REACH = 10
"""The filter reaches this many samples of the lower rate to either side."""
KEPT_BLOCK = 1 << 18
"""Samples of the lower rate that are computed at a time: memory stays bounded for any length."""
BETA = 5.0
"""Shape of the filter's Kaiser window."""


def decimated(samples: Samples, factor: int) -> Samples:
    """Return every ``factor``-th sample of a sound from which what the lower rate cannot hold is removed.

    samples : [shape=(N,)]
    factor  : at least 1
    Returns float32 [shape=(ceil(N / factor),)]; beyond its ends the sound is silent.
    Source: Oppenheim & Schafer, Discrete-Time Signal Processing, 4.6: a low-pass filter by a Kaiser window, computed
    only for the samples that are kept. The filter is that of ``scipy.signal.resample_poly``.
    """
    if factor == 1 or not len(samples):
        return samples
    half = REACH * factor
    at = np.arange(-half, half + 1)
    taps = np.sinc(at / factor) * np.kaiser(2 * half + 1, BETA)
    taps = (taps / taps.sum()).astype(np.float32)
    result = np.zeros(-(-len(samples) // factor), np.float32)
    for start in range(0, len(result), KEPT_BLOCK):
        part = result[start : start + KEPT_BLOCK]
        first = (start - REACH) * factor  # the sample that padded[0] is
        padded = np.zeros((len(part) + 2 * REACH + 1) * factor, np.float32)
        inside = samples[max(first, 0) : first + len(padded)]
        padded[max(-first, 0) :][: len(inside)] = inside
        phases = padded.reshape(-1, factor)  # sample n · factor + p of the sound is [n - first / factor, p]
        for phase in range(factor):
            part += np.convolve(phases[:, phase], taps[phase::factor][::-1], "valid")[: len(part)]
    return result
