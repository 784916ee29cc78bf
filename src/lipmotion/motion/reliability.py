"""How far recognised phones can be relied on, by how much noise and room cover the speech."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.rest import list_speech_intervals
from lipmotion.types import FRAME_RATE_HZ, Speech

Array = NDArray[np.float64]
DISTORTIONS = (0.2, 0.35)
"""Recognised phones are relied on up to the first distortion of the sound, and from the second one on not at all. The
network finds 0.17 to 0.27 in quiet recordings of its speaker, 0.40 to 0.50 in white noise at 20 dB, 0.45 to 0.63 in
babble at 20 dB."""
DISTORTION_S = 1.0
"""Seconds before and after a frame over which the distortion is averaged."""


def rate_phones(speech: Speech, distortion: Array | None, frames: int) -> Array:
    """Return how far the phones of speech can be relied on, 0 to 1 [shape=(frames,)].

    distortion : 0 to 1, of the sound in every frame, as a predictor finds it (None: there is none)
    Fully, where they are known; also where there are none: noise alone moves no mouth.
    """
    if speech.units_known or distortion is None or not list_speech_intervals(speech.units):
        return np.ones(frames)
    return np.maximum(rate_clearness(distortion), speech.confidence)


def rate_clearness(distortion: Array) -> Array:
    """Return how far a recording is free of noise and room around each frame, 0 to 1 [shape=(T,)]: ``DISTORTIONS``.

    distortion : of the sound in every frame [shape=(T,)]
    """
    frames = len(distortion)
    reach = int(DISTORTION_S * FRAME_RATE_HZ)
    total, numbers = np.concatenate([[0.0], np.cumsum(distortion)]), np.arange(frames)
    first, stop = np.maximum(numbers - reach, 0), np.minimum(numbers + reach + 1, frames)
    mean = (total[stop] - total[first]) / (stop - first)
    clear: Array = np.clip((DISTORTIONS[1] - mean) / (DISTORTIONS[1] - DISTORTIONS[0]), 0, 1)
    return clear
