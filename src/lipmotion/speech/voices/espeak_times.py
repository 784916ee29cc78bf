"""Corrections of the start times that espeak-ng's library reports.

It reports two kinds of phones too late. A stop is reported at its burst, after the 40 to 50 ms of silence of its
closure. An l at the end of a syllable is spoken with its vowel, and reported in its last 0 to 45 ms.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lipmotion.speech.voices.phone_maps import ESPEAK_PHONES, PhoneMap
from lipmotion.types import Audio, Span, Timeline
from lipmotion.units import SILENCE, list_phone_classes

CLOSING = list_phone_classes()["stop"] | list_phone_classes()["affricate"]
VOWELS = list_phone_classes()["vowel"]
CLOSURE_SHARE = 0.03
"""Share of the largest sample that no sample of a closure exceeds: some variants have breath in it."""
LONGEST_CLOSURE_S = 0.06
LATE_L_S, L_SHARE = 0.045, 0.45
"""An l that is reported so shortly before its end is late; it then gets this share of the vowel and l together, as in
the project's own alignments."""

Starts = Sequence[tuple[str, float]]


def corrected_phone_times(starts: Starts, audio: Audio, phone_map: PhoneMap = ESPEAK_PHONES) -> Timeline[str]:
    """Return phones in time: each from its corrected start to that of the next, or to the end of the sound.

    phone_map : the labels to phones of the inventory
    """
    labels = [label for label, _ in starts]
    edges_s = [*(start_s for _, start_s in starts), audio.duration_s]
    closed = np.abs(audio.samples) < CLOSURE_SHARE * np.abs(audio.samples).max(initial=0)
    for index in range(1, len(labels)):
        before, here = _phone(labels[index - 1], phone_map), _phone(labels[index], phone_map)
        if here in CLOSING and before != SILENCE:
            burst = round(edges_s[index] * audio.rate_hz)
            first = max(burst - round(LONGEST_CLOSURE_S * audio.rate_hz), 0)
            loud = np.flatnonzero(~closed[first:burst])
            closure_s = (first + int(loud[-1]) + 1 if len(loud) else first) / audio.rate_hz
            edges_s[index] = max(closure_s if burst > first else edges_s[index], edges_s[index - 1])
        elif here == "l" and before in VOWELS and edges_s[index + 1] - edges_s[index] < LATE_L_S:
            length_s = edges_s[index + 1] - edges_s[index - 1]
            edges_s[index] = min(edges_s[index], edges_s[index + 1] - L_SHARE * length_s)
    spans = zip(edges_s, edges_s[1:], labels, strict=False)
    return Timeline(tuple(Span(start_s, max(start_s, end_s), label) for start_s, end_s, label in spans))


def _phone(label: str, phone_map: PhoneMap) -> str:
    """Return the last phone of a label; empty for a label that is part of another phone or unknown."""
    return (phone_map.get(label) or ("",))[-1]
