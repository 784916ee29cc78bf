"""Phones as the 15 visemes of Oculus and OpenXR."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.mouth import SpokenMouth
from lipmotion.articulation.phone_targets import crossfade_phones
from lipmotion.articulation.rest import share_short_pauses
from lipmotion.meshes.model.shape_names import VISEMES_15
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
VISEME_CHANNELS = tuple(f"viseme_{name}" for name in VISEMES_15)
NEAREST_VOWEL = {
    **{"TH": "ih", "DD": "ih", "kk": "ih", "CH": "ou", "SS": "ih", "nn": "ih", "RR": "oh", "E": "ee"},
    **{"aa": "aa", "ih": "ih", "oh": "oh", "ou": "ou"},
}
"""The vowel of VRM for each viseme that opens the mouth."""
LAX = "E"
"""The viseme of parted lips in a pause."""
MAX_CLOSED_WEIGHT = 0.85
"""Largest sum of the visemes of closed lips where the lips are parted."""
CLOSED_GAPS, PARTED_GAPS = (0.0, 0.04), (0.06, 0.16)
"""Gaps between which the least, and the largest, sum of the visemes of closed lips falls to 0, in eye distances."""
MIN_WEIGHT = 1e-6


def weigh_visemes(units: Timeline[Unit], mouth: SpokenMouth) -> Motion:
    """Return the weights of the 15 visemes over time, channels ``viseme_sil``, ``viseme_PP``, ...; 0 to 1.

    units : phones in time;  mouth : that they move
    At every time the weights add up to 1. The visemes of closed lips, ``viseme_sil`` and ``viseme_PP``, add up to 1
    where the lips of the mouth touch, and to at most ``MAX_CLOSED_WEIGHT`` where they do not.
    """
    phones = viseme_curves(units, np.arange(len(mouth.gap)) / mouth.rate_hz)
    wanted = phones["sil"] + phones["PP"]
    low, high = (
        MAX_CLOSED_WEIGHT * np.clip((far - mouth.gap) / (far - near), 0, 1) for near, far in (CLOSED_GAPS, PARTED_GAPS)
    )
    closed = np.where(mouth.contact, 1.0, np.maximum(low, np.minimum(wanted, high)))
    silent = np.divide(phones["sil"], wanted, out=np.zeros_like(wanted), where=wanted > MIN_WEIGHT)
    spoken = np.divide(1 - closed, 1 - wanted, out=np.zeros_like(wanted), where=wanted < 1 - MIN_WEIGHT)
    curves = {name: spoken * curve for name, curve in phones.items()}
    curves |= {"sil": closed * silent, "PP": closed * (1 - silent)}
    curves[LAX] += np.where(wanted < 1 - MIN_WEIGHT, 0.0, 1 - closed)
    values = np.stack([np.clip(curves[name], 0, 1) for name in VISEMES_15], axis=1)
    return Motion(values, mouth.rate_hz, tuple(Channel(name, WEIGHT) for name in VISEME_CHANNELS))


def viseme_curves(units: Timeline[Unit], time_s: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Return how far each of the 15 visemes is being said at some times, 0 to 1 [each shape=(len(time_s),)].

    Pauses in which the mouth goes on (``articulation.pauses``) belong to the phones beside them.
    """
    weights = crossfade_phones(share_short_pauses(units), time_s, lambda phone: VISEME_OF_PHONE.get(phone, "sil"))
    return {name: np.clip(weights.get(name, np.zeros(len(time_s))), 0.0, 1.0) for name in VISEMES_15}
