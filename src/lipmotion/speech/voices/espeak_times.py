"""When a phone of espeak-ng begins, other than its library says.

Two things that it says are not so. Stops are reported at their burst: the silence of the closure, 40 to 50 ms of it,
comes before. An l at the end of a syllable is spoken with its vowel, and reported in its last 0 to 45 ms.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.speech.voices.phone_maps import ESPEAK_PHONES
from lipmotion.types import Audio, Span, Timeline
from lipmotion.units import SILENCE, phone_classes

CLOSING = phone_classes()["stop"] | phone_classes()["affricate"]
VOWELS = phone_classes()["vowel"]
CLOSED = 0.005
"""Of the largest sample: nothing louder is heard in a closure."""
LONGEST_CLOSURE_S = 0.06
LATE_L_S, SHARE_OF_L = 0.045, 0.45
"""An l that begins so shortly before it ends is late; this share of vowel and l together is its own, as the project's
aligner hears it."""

Starts = Sequence[tuple[str, float]]


def corrected_phone_times(starts: Starts, audio: Audio) -> Timeline[str]:
    """Return phones in time: each from its start on, put right, until the next or the end of the sound."""
    labels = [label for label, _ in starts]
    edges_s = [*(start_s for _, start_s in starts), audio.duration_s]
    closed = np.abs(audio.samples) < CLOSED * np.abs(audio.samples).max(initial=0)
    for place in range(1, len(labels)):
        before, here = _sound(labels[place - 1]), _sound(labels[place])
        if here in CLOSING and before != SILENCE:
            edges_s[place] = max(_closure_s(closed, edges_s[place], audio.rate_hz), edges_s[place - 1])
        elif here == "l" and before in VOWELS and edges_s[place + 1] - edges_s[place] < LATE_L_S:
            length_s = edges_s[place + 1] - edges_s[place - 1]
            edges_s[place] = min(edges_s[place], edges_s[place + 1] - SHARE_OF_L * length_s)
    spans = zip(edges_s, edges_s[1:], labels, strict=False)
    return Timeline(tuple(Span(start_s, max(start_s, end_s), label) for start_s, end_s, label in spans))


def _sound(label: str) -> str:
    """Return the last phone of a label; nothing for parts of others, and for what is not known."""
    return (ESPEAK_PHONES.get(label) or ("",))[-1]


def _closure_s(closed: NDArray[np.bool_], burst_s: float, rate_hz: int) -> float:
    """Return when the silence before a burst began."""
    burst = round(burst_s * rate_hz)
    first = max(burst - round(LONGEST_CLOSURE_S * rate_hz), 0)
    loud = np.flatnonzero(~closed[first:burst])
    return (first + int(loud[-1]) + 1 if len(loud) else first) / rate_hz if burst > first else burst_s
