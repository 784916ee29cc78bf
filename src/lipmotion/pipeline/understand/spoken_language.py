"""Whether a recording is in English, by the words that a network for the phones of any speaker divides it into."""

from __future__ import annotations

from itertools import groupby

from lipmotion.speech.recognition.network.posteriors import (
    WORD_BOUNDARY,
    PhonePosteriors,
    installed_phone_recogniser,
    phone_recogniser,
)
from lipmotion.types import Audio
from lipmotion.units.ipa_phones import token_phones
from lipmotion.units.languages_told import is_english

PART_S, PARTS = 14.0, 2
"""The first seconds of a recording are listened to, in parts of this length: the network's memory grows with it."""


def english_spoken(audio: Audio) -> bool | None:
    """Return whether a recording is in English; None: not known, or no phone recogniser is installed.

    audio : at 16 kHz
    The network writes every language with the phones of English: it cannot say which other one it is.
    """
    name = installed_phone_recogniser()
    if name is None:
        return None
    recogniser, tokens = phone_recogniser(name), list[str]()
    count = int(PART_S * audio.rate_hz)
    for first in range(0, min(len(audio.samples), PARTS * count), count):
        values = recogniser.log_posteriors(audio.samples[first : first + count])
        found = PhonePosteriors(values, recogniser.tokens).best_tokens
        tokens += [*(each.token for each in found), WORD_BOUNDARY]
    words = (list(group) for ends, group in groupby(tokens, WORD_BOUNDARY.__eq__) if not ends)
    return is_english(tuple(phone for phone, _ in token_phones(word)) for word in words)
