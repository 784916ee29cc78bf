"""Phones in time of recordings: by forced alignment of a transcript, or by recognition."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

from lipmotion.corpora.labels import check_plain_text, read_transcript
from lipmotion.errors import shortened
from lipmotion.hmm.loudness import loud_frames
from lipmotion.speech.agreement import DOUBTFUL_SCORE, agreement_score
from lipmotion.speech.anchors import anchors_of, fitted
from lipmotion.speech.mfcc import LOG_ENERGY
from lipmotion.speech.recogniser import ENERGY_SMOOTHING_FRAMES, Recogniser
from lipmotion.storage.files import read_text_file
from lipmotion.types import Audio, Features, TimedTranscript, Timeline, Unit
from lipmotion.units import Lexicon, check_words
from lipmotion.units.length_limits import LARGEST_TRANSCRIPT

__all__ = ["phones_in_time", "read_plain_text", "read_transcript", "transcribe", "warn_of_guesses"]
LOG = logging.getLogger("lipmotion")
MOST_WARNINGS = 20
"""Largest number of guessed pronunciations that are reported one by one."""


def transcribe(
    phones: Recogniser,
    audio: Audio,
    features: Features,
    words: Sequence[str] | TimedTranscript | None,
    lexicon: Lexicon,
) -> Timeline[Unit]:
    """Return the phones in time of a recording, with warnings for the user.

    phones   : the recogniser
    features : of the audio, from ``mfcc``
    words    : the spoken words in lower case, also with times, within which they are aligned; or None
    Warnings are logged for guessed pronunciations and, with general phone models, for words that do not agree with the
    sound.
    Raises AlignmentError: the words cannot be aligned with the recording.
    """
    if isinstance(words, TimedTranscript):
        loud = loud_frames(features.values[:, LOG_ENERGY], ENERGY_SMOOTHING_FRAMES)
        words = fitted(words, loud, audio.duration_s)
    warn_of_guesses(words.words if isinstance(words, TimedTranscript) else words or (), lexicon)
    units = phones_in_time(phones, audio, features, words, lexicon)
    if words is not None and phones.kind != "own":
        warn_of_disagreement(audio, units)
    return units


def phones_in_time(
    phones: Recogniser,
    audio: Audio,
    features: Features,
    words: Sequence[str] | TimedTranscript | None,
    lexicon: Lexicon,
) -> Timeline[Unit]:
    """Return the phones in time of a recording as ``transcribe`` does, without warnings."""
    if words is None:
        return phones.recognise(audio, features)
    anchors = None
    if isinstance(words, TimedTranscript):
        anchors, words = anchors_of(words) if words.has_times else None, words.words
    check_words(words, audio.duration_s)
    return phones.align(audio, features, words, lexicon, anchors)


def read_plain_text(path: Path) -> str:
    """Return the text of a file of words alone.

    Raises InputError: no such file, larger than ``LARGEST_TRANSCRIPT``, not UTF-8 text, or labels in time.
    """
    text = read_text_file(path, "transcript", LARGEST_TRANSCRIPT)
    check_plain_text(text, str(path))
    return text


def warn_of_disagreement(audio: Audio, units: Timeline[Unit]) -> None:
    """Log a warning if the aligned phones of a transcript do not agree with the sound."""
    score = agreement_score(audio, units)
    if score < DOUBTFUL_SCORE:
        LOG.warning(
            "the transcript seems not to be what is said (its phones agree with the sound at %.1f, required %.1f or "
            "more); check it, or leave it out",
            score,
            DOUBTFUL_SCORE,
        )


def warn_of_guesses(words: Sequence[str], lexicon: Lexicon) -> None:
    """Log a warning for every word whose pronunciation is a guess; after ``MOST_WARNINGS``, for how many more."""
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
