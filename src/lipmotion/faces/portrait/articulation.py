"""Articulatory gestures that follow from the phones, not from lip motion: lip on the teeth, tip of the tongue."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import Timeline, Unit
from lipmotion.units import LIP_CLOSING, PAUSE, SILENCE

BLEND_S = 0.06
"""A gesture grows and fades over this long, centred on the boundaries of its phone."""
TUCKS: Mapping[str, float] = {"f": 1.0, "v": 1.0}
"""The lower lip touches the upper teeth."""
CLOSURES: Mapping[str, float] = dict.fromkeys(LIP_CLOSING, 1.0)
"""The lips touch; a tuck next to one of these ends before it begins."""
LEAST_PAUSE_S = 0.15
"""In shorter pauses between words the mouth goes on."""
TIP_RAISES: Mapping[str, float] = {"th": 1.0, "dh": 1.0, "l": 0.8, "el": 0.8, "t": 0.4, "d": 0.4, "n": 0.4, "en": 0.4}
"""The tip of the tongue is between the teeth, or behind the upper ones, where less of it is visible."""


def gesture_weight(
    units: Timeline[Unit], strengths: Mapping[str, float], time_s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the weight of a gesture at each time, 0..1 [shape=(T,)].

    strengths : of the gesture, by phone
    Between neighbouring phones of the same gesture the weight stays the same: their slopes add up to 1.
    """
    total = np.zeros(len(time_s))
    for span in units:
        strength = strengths.get(span.label.phone)
        if strength:
            total += strength * (_risen(time_s - span.start_s) - _risen(time_s - span.end_s))
    return np.minimum(total, 1)


def pause_weight(units: Timeline[Unit], time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weight of pauses of ``LEAST_PAUSE_S`` or more at each time, 0..1 [shape=(T,)]."""
    long = tuple(span for span in units if span.duration_s >= LEAST_PAUSE_S)
    return gesture_weight(Timeline(long), dict.fromkeys((SILENCE, PAUSE), 1.0), time_s)


def _risen(after_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a smooth step from 0 to 1 that is 0.5 at 0 seconds."""
    share = np.clip(after_s / BLEND_S + 0.5, 0, 1)
    rise: NDArray[np.float64] = share * share * (3 - 2 * share)
    return rise
