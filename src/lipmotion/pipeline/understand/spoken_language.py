"""Whether a recording is in English, by the words that a network for the phones of any speaker divides it into."""

from __future__ import annotations

import logging
from itertools import groupby

from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.recognition.network.posteriors import (
    WORD_BOUNDARY,
    installed_phone_recogniser,
    posterior_stretches,
)
from lipmotion.speech.recognition.recognised_speech import Recognition
from lipmotion.types import Audio
from lipmotion.units.ipa_phones import read_tokens
from lipmotion.units.language_detection import is_english

LOG = logging.getLogger("lipmotion")
LEAST_CONFIDENCE = 0.4
"""English words are recognised with at least this confidence in clear English (0.8 to 0.9 there), and with less in
other languages and in English played backwards (0.18 to 0.25), and in noise."""
LEAST_TOLD_S = 1.0
"""Speech that lasts less says nothing of its language."""
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
    return is_english(tuple(phone for phone, _ in read_tokens(word)) for word in words)


def confidence_of(found: Recognition) -> float:
    """Return the confidence of recognised words times their share of the speech, 0 to 1."""
    return (found.confidence or 0.0) * found.word_s / max(found.word_s + found.phone_s, 1e-9)


def warn_of_another_language(found: Recognition) -> None:
    """Log a warning where English words were recognised in what is hardly English."""
    confidence = confidence_of(found)
    if found.word_s >= LEAST_TOLD_S and confidence < LEAST_CONFIDENCE:
        LOG.warning(
            "the words are hardly understood (confidence %.2f, required %.1f): the speech may not be English, then "
            "give its language (--language es, fr, de, ...); or it is noisy, then give its words (--transcript)",
            *(confidence, LEAST_CONFIDENCE),
        )
