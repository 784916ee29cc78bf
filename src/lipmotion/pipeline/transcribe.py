"""Recordings to phones in time: with a transcript by alignment, without one by recognition."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

from lipmotion.corpora.labels import check_plain_text
from lipmotion.errors import shortened
from lipmotion.speech.agreement import DOUBTFUL_SCORE, agreement_score
from lipmotion.speech.recogniser import Recogniser
from lipmotion.storage.files import read_text_file
from lipmotion.types import Audio, Features, Timeline, Unit
from lipmotion.units import Lexicon, check_words
from lipmotion.units.length_limits import LARGEST_TRANSCRIPT

LOG = logging.getLogger("lipmotion")
MOST_WARNINGS = 20
"""Words of which it is said one by one how they were guessed."""


def transcribe(
    phones: Recogniser, audio: Audio, features: Features, words: Sequence[str] | None, lexicon: Lexicon
) -> Timeline[Unit]:
    """Return the phones of a recording.

    features : of the audio, from ``mfcc``
    words    : what is said in it, lower case, or None
    A warning says if the words are hardly what is said (only where general models listen).
    Raises AlignmentError: the words do not fit into the recording.
    """
    warn_of_guesses(words or (), lexicon)
    units = phones_in_time(phones, audio, features, words, lexicon)
    if words is not None and phones.kind != "own":
        warn_of_disagreement(audio, units)
    return units


def phones_in_time(
    phones: Recogniser, audio: Audio, features: Features, words: Sequence[str] | None, lexicon: Lexicon
) -> Timeline[Unit]:
    """Return the same without a word about guesses, for many recordings."""
    if words is None:
        return phones.recognise(audio, features)
    check_words(words, audio.duration_s)
    return phones.align(audio, features, words, lexicon)


def read_transcript(path: Path) -> str:
    """Return the text of a file.

    Raises InputError: no such file, larger than ``LARGEST_TRANSCRIPT``, not UTF-8 text, or labels in time.
    """
    text = read_text_file(path, "transcript", LARGEST_TRANSCRIPT)
    check_plain_text(text, str(path))
    return text


def warn_of_disagreement(audio: Audio, units: Timeline[Unit]) -> None:
    """Warn if the phones of a transcript, aligned, are not what is heard."""
    found = agreement_score(audio, units)
    if found < DOUBTFUL_SCORE:
        LOG.warning(
            "the transcript seems not to be what is said (its phones agree with the sound at %.1f, required %.1f or "
            "more); check it, or leave it out",
            found,
            DOUBTFUL_SCORE,
        )


def warn_of_guesses(words: Sequence[str], lexicon: Lexicon) -> None:
    """Warn of every word whose pronunciation is a guess; of many, say the first ``MOST_WARNINGS`` and how many more."""
    unknown = [word for word in dict.fromkeys(words) if not lexicon.known(word)]
    for word in unknown[:MOST_WARNINGS]:
        guessed = " ".join(lexicon.pronunciations(word)[0])
        LOG.warning(
            "%r is not in the dictionary; read as %r; a lexicon file can say better", *map(shortened, (word, guessed))
        )
    if len(unknown) > MOST_WARNINGS:
        LOG.warning(
            "%d more words are not in the dictionary; a lexicon file can say better", len(unknown) - MOST_WARNINGS
        )
