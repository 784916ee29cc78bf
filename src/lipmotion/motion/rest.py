"""Silence away from speech, in which the mouth is in its rest pose."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import Timeline, Unit
from lipmotion.units import is_silent

Array = NDArray[np.float64]


def away_from_speech(time_s: Array, speech_s: Sequence[tuple[float, float]], margin_s: float) -> NDArray[np.bool_]:
    """Return which times are further than ``margin_s`` seconds from all speech, before and after it [shape=(T,)].

    time_s   : times in seconds [shape=(T,)]
    speech_s : start and end of every interval of speech, in seconds, in order and without overlap
    Cost: O(T log N) for N intervals.
    """
    starts_s = np.array([-np.inf, *(start_s for start_s, _ in speech_s), np.inf])
    ends_s = np.array([-np.inf, *(end_s for _, end_s in speech_s), np.inf])
    last = np.searchsorted(starts_s, time_s, side="right") - 1  # the last interval that begins at or before a time
    away: NDArray[np.bool_] = (time_s > ends_s[last] + margin_s) & (time_s < starts_s[last + 1] - margin_s)
    return away


def speech_intervals(units: Timeline[Unit]) -> list[tuple[float, float]]:
    """Return start and end, in seconds, of every phone that is not silence."""
    return [(span.start_s, span.end_s) for span in units if not is_silent(span.label.phone)]
