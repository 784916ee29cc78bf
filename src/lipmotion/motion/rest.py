"""Silence away from speech, in which the mouth is in its rest pose."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import Timeline, Unit
from lipmotion.units import is_silent

Array = NDArray[np.float64]


def away_from_speech(time_s: Array, speech_s: Iterable[tuple[float, float]], margin_s: float) -> NDArray[np.bool_]:
    """Return which times are further than ``margin_s`` seconds from all speech, before and after it [shape=(T,)].

    time_s   : times in seconds [shape=(T,)]
    speech_s : start and end of every interval of speech, in seconds
    """
    away = np.ones(len(time_s), bool)
    for start_s, end_s in speech_s:
        away &= (start_s - time_s > margin_s) | (time_s - end_s > margin_s)
    return away


def speech_intervals(units: Timeline[Unit]) -> list[tuple[float, float]]:
    """Return start and end, in seconds, of every phone that is not silence."""
    return [(span.start_s, span.end_s) for span in units if not is_silent(span.label.phone)]
