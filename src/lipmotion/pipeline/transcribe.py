"""Recordings to phones in time: with a transcript by alignment, without one by recognition."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.speech.recogniser import Recogniser
from lipmotion.types import Audio, Features, Timeline, Unit
from lipmotion.units import Lexicon

LOG = logging.getLogger("lipmotion")


def transcribe(
    phones: Recogniser, audio: Audio, features: Features, words: Sequence[str] | None, lexicon: Lexicon
) -> Timeline[Unit]:
    """Return the phones of a recording.

    features : of the audio, from ``mfcc``
    words    : what is said in it, lower case, or None
    Raises AlignmentError: the words do not fit into the recording.
    """
    report_guesses(words or (), lexicon)
    return phones_in_time(phones, audio, features, words, lexicon)


def phones_in_time(
    phones: Recogniser, audio: Audio, features: Features, words: Sequence[str] | None, lexicon: Lexicon
) -> Timeline[Unit]:
    """Return the same without a word about guesses, for many recordings."""
    if words is None:
        return phones.recognise(audio, features)
    return phones.align(audio, features, words, lexicon)


def read_transcript(path: Path) -> str:
    """Return the text of a file. Raises InputError: no such file, or not UTF-8 text."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such transcript file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a readable UTF-8 text ({error})") from error


def report_guesses(words: Sequence[str], lexicon: Lexicon) -> None:
    """Warn of every word whose pronunciation is a guess."""
    for word in dict.fromkeys(words):
        if not lexicon.known(word):
            guessed = " ".join(lexicon.pronunciations(word)[0])
            LOG.warning("%r is not in the dictionary; read as %r; a lexicon file can say better", word, guessed)
