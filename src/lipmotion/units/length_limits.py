"""Limits on how much text or how many phones go with a recording; they are checked before anything is aligned."""

from __future__ import annotations

from collections.abc import Sequence

from lipmotion.errors import AlignmentError, InputError

CHARACTERS_PER_S = 200
"""Most characters a second: three times the fastest speech on record (655 words a minute), blanks and punctuation."""
ALWAYS_ALLOWED_CHARACTERS = 10_000
"""Characters that a text may always have, as notes and blank lines beside the words of a short recording."""
LARGEST_TRANSCRIPT_BYTES = 1 << 22
"""Most bytes of a transcript file: three days of speech."""
PHONES_PER_S = 100
"""Most phones a second: with more, a phone has less than one frame of 10 ms on average."""
ALWAYS_ALLOWED_PHONES = 1000
"""Phones that a list may always have; if they are those of another recording, a warning is enough."""


def check_text(text: str, duration_s: float) -> None:
    """Raise AlignmentError for a text that nobody can say within this duration."""
    _check_characters(len(text), duration_s)


def check_words(words: Sequence[str], duration_s: float) -> None:
    """Raise AlignmentError for words that nobody can say within this duration."""
    _check_characters(sum(map(len, words)) + len(words), duration_s)


def check_phones(count: int, duration_s: float) -> None:
    """Raise InputError for more phones in time than there are frames in this duration."""
    most = ALWAYS_ALLOWED_PHONES + int(PHONES_PER_S * duration_s)
    if count > most:
        raise InputError(
            f"{count} units in time, required at most {most} for {duration_s:.2f} s of sound; give those of this "
            "recording"
        )


def _check_characters(count: int, duration_s: float) -> None:
    most = ALWAYS_ALLOWED_CHARACTERS + int(CHARACTERS_PER_S * duration_s)
    if count > most:
        raise AlignmentError(
            f"the transcript has {count} characters, required at most {most} for {duration_s:.2f} s of sound: nobody "
            "says so much; give the words of this recording"
        )
