"""Whether a recording is in English, by the words that a network for the phones of any speaker divides it into."""

from __future__ import annotations

from itertools import groupby

from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.recognition.network.posteriors import (
    WORD_BOUNDARY,
    installed_phone_recogniser,
    posterior_stretches,
)
from lipmotion.types import Audio
from lipmotion.units.ipa_phones import token_phones
from lipmotion.units.languages_told import is_english

PART_S = 28.0
"""So many seconds from the beginning of a recording tell its language."""


def english_spoken(audio: Audio) -> bool | None:
    """Return whether a recording is in English; None: not known, or no phone recogniser is installed.

    audio : at 16 kHz
    The network writes every language with the phones of English: it cannot say which other one it is.
    """
    name = installed_phone_recogniser()
    if name is None:
        return None
    part = analysed(Audio(audio.samples[: int(PART_S * audio.rate_hz)], audio.rate_hz))
    tokens = [
        token
        for _, posteriors in posterior_stretches(name, part)
        for token in (*(each.token for each in posteriors.best_tokens), WORD_BOUNDARY)
    ]
    words = (list(group) for ends, group in groupby(tokens, WORD_BOUNDARY.__eq__) if not ends)
    return is_english(tuple(phone for phone, _ in token_phones(word)) for word in words)
