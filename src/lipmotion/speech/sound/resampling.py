"""Sound in memory at the rate of speech, as it would be read from its file."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

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
