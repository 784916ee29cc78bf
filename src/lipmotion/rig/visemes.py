"""Phones as the 15 visemes of Oculus and OpenXR."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.rig.gestures import phone_weights
from lipmotion.rig.shape_names import VISEMES_15
from lipmotion.types import WEIGHT, Channel, Motion, Timeline, Unit

VISEME_PHONES = {
    "sil": "sil sp",
    "PP": "p b m em",
    "FF": "f v",
    "TH": "th dh",
    "DD": "t d",
    "kk": "k g hh",
    "CH": "ch jh sh zh",
    "SS": "s z",
    "nn": "n l ng en el",
    "RR": "r er axr",
    "aa": "aa ay aw ah",
    "E": "eh ey ae ax",
    "ih": "ih iy ix y",
    "oh": "ao ow oy",
    "ou": "uw uh w",
}
"""The phones of each viseme (the groups of the Oculus LipSync reference, in the project's phones)."""
VISEME_OF_PHONE = {phone: viseme for viseme, phones in VISEME_PHONES.items() for phone in phones.split()}
NEAREST_VOWEL = {
    **{"TH": "ih", "DD": "ih", "kk": "ih", "CH": "ou", "SS": "ih", "nn": "ih", "RR": "oh", "E": "ee"},
    **{"aa": "aa", "ih": "ih", "oh": "oh", "ou": "ou"},
}
"""The vowel of VRM for each viseme that opens the mouth."""


def viseme_of(phone: str) -> str:
    """Return the viseme of a phone; ``sil`` of an empty or unknown one."""
    return VISEME_OF_PHONE.get(phone, "sil")


def viseme_motion(units: Timeline[Unit], frames: int, rate_hz: float) -> Motion:
    """Return the weights of the 15 visemes over time, channels ``viseme_sil``, ``viseme_PP``, ...; 0 to 1.

    units : phones in time
    At every time the weights add up to 1. In silence ``viseme_sil`` is 1 and all others are 0; in the middle of p,
    b and
    m ``viseme_PP`` is 1.
    """
    said = viseme_curves(units, np.arange(frames) / rate_hz)
    values = np.stack([said[name] for name in VISEMES_15], axis=1)
    return Motion(values, rate_hz, tuple(Channel(f"viseme_{name}", WEIGHT) for name in VISEMES_15))


def viseme_curves(units: Timeline[Unit], time_s: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Return the weight of each of the 15 visemes at some times [each shape=(len(time_s),)]."""
    said = phone_weights(units, time_s, viseme_of)
    return {name: np.clip(said.get(name, np.zeros(len(time_s))), 0.0, 1.0) for name in VISEMES_15}
