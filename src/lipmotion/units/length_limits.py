"""How much can be said in a recording: what is longer is refused before it is split into words or phones."""

from __future__ import annotations

from collections.abc import Sequence

from lipmotion.errors import AlignmentError, InputError

CHARACTERS_PER_S = 200
"""Three times the fastest speech on record (655 words a minute), and more for blanks and punctuation."""
SHORT_TEXT = 10_000
"""Characters that a text may always have: notes and blank lines around the words of a short recording."""
LARGEST_TRANSCRIPT = 1 << 22
"""Bytes of a file of words: what is said in three days of speech."""
PHONES_PER_S = 100
"""Speech is heard in frames of 10 ms: a phone that is shorter on average has no frame of its own."""
FEW_PHONES = 1000
"""Phones that a list may always have: those of another recording are a mistake that a warning is enough for."""


def check_text(text: str, duration_s: float) -> None:
    """Raise AlignmentError for a text that nobody can say in a recording of this duration."""
    _check_characters(len(text), duration_s)


def check_words(words: Sequence[str], duration_s: float) -> None:
    """Raise AlignmentError for words that nobody can say in a recording of this duration."""
    _check_characters(sum(map(len, words)) + len(words), duration_s)


def check_phones(count: int, duration_s: float) -> None:
    """Raise InputError for more phones in time than a recording of this duration has frames for."""
    most = FEW_PHONES + int(PHONES_PER_S * duration_s)
    if count > most:
        raise InputError(
            f"{count} units in time, required at most {most} for {duration_s:.2f} s of sound; give those of this "
            "recording"
        )


def _check_characters(count: int, duration_s: float) -> None:
    most = SHORT_TEXT + int(CHARACTERS_PER_S * duration_s)
    if count > most:
        raise AlignmentError(
            f"the transcript has {count} characters, required at most {most} for {duration_s:.2f} s of sound: nobody "
            "says so much; give the words of this recording"
        )
