"""Silence away from speech, in which the mouth is in its rest pose."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import ENERGY_FEATURE, FRAME_RATE_HZ, Timeline, Unit
from lipmotion.units import is_silent

Array = NDArray[np.float64]
BEFORE_SPEECH_S = 0.05
"""Mouths open or close for the first phone this long before it."""
LEAST_SILENCE_S, FLOOR_MARGIN = 0.05, 1e-4


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
    The log energy stays at its floor for ``LEAST_SILENCE_S``, and speech is further away than ``BEFORE_SPEECH_S``.
    """
    energy = features[:, ENERGY_FEATURE]
    at_floor = energy <= energy.min() + FLOOR_MARGIN
    silent = np.zeros(len(energy), bool)
    for first, stop in find_runs(at_floor):
        silent[first:stop] = stop - first >= LEAST_SILENCE_S * FRAME_RATE_HZ
    time_s = np.arange(len(energy)) / FRAME_RATE_HZ
    return silent & is_away_from_speech(time_s, list_speech_intervals(units), BEFORE_SPEECH_S)
