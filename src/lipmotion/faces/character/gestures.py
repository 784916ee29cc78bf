"""What phones say of the mouth beside the motion: lips pressed, round, spread or tucked, and where the tongue is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import Timeline, Unit
from lipmotion.units import LIP_CLOSING, PAUSE, SILENCE

Curve = NDArray[np.float64]


@dataclass(frozen=True)
class Gesture:
    """A gesture of some phones.

    strengths : by phone, 0 to 1
    rise_s    : time in which it grows before the phone, and fades after it, half of it inside the phone
    early_s   : how long before the phone it begins in addition
    """

    strengths: Mapping[str, float]
    rise_s: float = 0.07
    early_s: float = 0.0

    def weight(self, units: Timeline[Unit], time_s: Curve) -> Curve:
        """Return the weight of the gesture at each time, 0 to 1 [shape=(T,)].

        Between neighbouring phones of the same gesture the weight stays the same: their slopes add up to 1.
        """
        total = np.zeros(len(time_s))
        for span in units:
            strength = self.strengths.get(span.label.phone)
            if strength:
                near = slice(*np.searchsorted(time_s, (span.start_s - 0.5, span.end_s + 0.5)))
                grown = self._grown(time_s[near] - span.start_s + self.early_s) - self._grown(time_s[near] - span.end_s)
                total[near] += strength * grown
        return np.clip(total, 0, 1)

    def _grown(self, after_s: Curve) -> Curve:
        share = np.clip(after_s / self.rise_s + 0.5, 0, 1)
        return np.asarray(share * share * (3 - 2 * share))


GESTURES = {
    "close": Gesture(dict.fromkeys(LIP_CLOSING, 1.0), 0.07),
    "press": Gesture(dict.fromkeys(LIP_CLOSING, 1.0), 0.05),
    "tuck": Gesture({"f": 1.0, "v": 1.0}, 0.06),
    "tongue_out": Gesture({"th": 1.0, "dh": 0.9}, 0.06),
    "tongue_up": Gesture({"l": 0.85, "el": 0.85, "t": 0.65, "d": 0.65, "n": 0.75, "en": 0.75}, 0.06),
    "round": Gesture(
        {
            "uw": 1.0, "w": 1.0, "ow": 0.8, "uh": 0.6, "ao": 0.4, "oy": 0.6, "r": 0.4, "er": 0.4, "axr": 0.3,
            "sh": 0.5, "zh": 0.5, "ch": 0.5, "jh": 0.5, "aw": 0.35,
        },
        0.11, 0.03,
    ),
    "pucker": Gesture({"w": 1.0}, 0.08, 0.02),
    "hold": Gesture({"uw": 1.0, "ow": 0.8}, 0.05),
    "spread": Gesture(
        {
            "iy": 1.0, "ey": 0.7, "ih": 0.5, "ix": 0.4, "y": 0.6, "s": 0.4, "z": 0.4, "ae": 0.35, "ay": 0.3, "eh": 0.3,
        },
        0.10, 0.03,
    ),
    "oval": Gesture({"aa": 1.0, "ao": 0.8, "aw": 0.7, "ay": 0.4, "ah": 0.4, "ax": 0.2}, 0.12, 0.03),
    "bite": Gesture(dict.fromkeys(("s", "z", "sh", "zh", "ch", "jh"), 1.0), 0.08),
}  # fmt: skip
"""The gestures by name. ``close`` brings the lips together; ``press`` rolls them in while they are.
``pucker`` makes round lips tighter, almost closed; ``hold`` keeps them a little open."""
SILENT = Gesture(dict.fromkeys((SILENCE, PAUSE), 1.0), 0.10)
LEAST_PAUSE_S, AFTER_S, BEFORE_S = 0.25, 0.06, 0.12
"""In shorter pauses the mouth goes on; a pause begins later and ends earlier for the lips than for the ear."""


def pause_weight(units: Timeline[Unit], time_s: Curve) -> Curve:
    """Return the weight of pauses of ``LEAST_PAUSE_S`` or more at each time, 0 to 1 [shape=(T,)]."""
    long = tuple(
        replace(span, start_s=span.start_s + AFTER_S * (span.start_s > 0), end_s=span.end_s - BEFORE_S)
        for span in units
        if span.duration_s >= LEAST_PAUSE_S
    )
    return SILENT.weight(Timeline(long), time_s)
