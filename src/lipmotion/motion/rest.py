"""Silence away from speech, in which the mouth is in its rest pose; how far noise lets phones be relied on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import ENERGY_FEATURE, FRAME_RATE_HZ, Speech, Timeline, Unit
from lipmotion.units import is_silent

Array = NDArray[np.float64]
BEFORE_SPEECH_S = 0.05
"""Mouths open or close for the first phone this long before it."""
MIN_SILENCE_S, FLOOR_MARGIN = 0.05, 1e-4
DISTORTIONS = (0.2, 0.35)
"""Recognised phones are relied on up to the first distortion of the sound, and from the second one on not at all. The
network finds 0.17 to 0.27 in quiet recordings of its speaker, 0.40 to 0.50 in white noise at 20 dB, 0.45 to 0.63 in
babble at 20 dB."""
DISTORTION_S = 1.0
"""Seconds before and after a frame over which the distortion is averaged."""


def is_away_from_speech(time_s: Array, speech_s: Sequence[tuple[float, float]], margin_s: float) -> NDArray[np.bool_]:
    """Return which times are further than ``margin_s`` seconds from all speech, before and after it [shape=(T,)].

    time_s   : times in seconds [shape=(T,)]
    speech_s : start and end of every interval of speech, in seconds, in order and without overlap
    Cost: O(T log N) for N intervals.
    """
    starts_s = np.array([-np.inf, *(start_s for start_s, _ in speech_s), np.inf])
    ends_s = np.array([-np.inf, *(end_s for _, end_s in speech_s), np.inf])
    last = np.searchsorted(starts_s, time_s, side="right") - 1  # the last interval that begins at or before a time
    return (time_s > ends_s[last] + margin_s) & (time_s < starts_s[last + 1] - margin_s)


def find_runs(mask: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return first frame and the one after the last of each run of frames in which a mask is True [shape=(R, 2)].

    mask : bool array [shape=(T,)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return edges.reshape(-1, 2)


def list_speech_intervals(units: Timeline[Unit]) -> list[tuple[float, float]]:
    """Return start and end, in seconds, of every phone that is not silence."""
    return [(span.start_s, span.end_s) for span in units if not is_silent(span.label.phone)]


def find_digital_silence(features: NDArray[np.floating], units: Timeline[Unit]) -> NDArray[np.bool_]:
    """Return the frames of digital silence, in which the mouth rests: without even a breath [shape=(T,)].

    features : acoustic features [shape=(T, D)]
    The log energy stays at its floor for ``MIN_SILENCE_S``, and speech is further away than ``BEFORE_SPEECH_S``.
    """
    energy = features[:, ENERGY_FEATURE]
    at_floor = energy <= energy.min() + FLOOR_MARGIN
    silent = np.zeros(len(energy), bool)
    for first, stop in find_runs(at_floor):
        silent[first:stop] = stop - first >= MIN_SILENCE_S * FRAME_RATE_HZ
    time_s = np.arange(len(energy)) / FRAME_RATE_HZ
    return silent & is_away_from_speech(time_s, list_speech_intervals(units), BEFORE_SPEECH_S)


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
