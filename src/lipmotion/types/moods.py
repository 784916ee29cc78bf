"""Moods and manners over time: what a face expresses beside what it says, and how it says it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

from lipmotion.errors import InputError, shorten

NEUTRAL = "neutral"
MOODS = ("happy", "sad", "angry", "afraid", "disgusted", "surprised", "tense", "tired")
"""The moods that a face shows beside none, ``NEUTRAL``."""
PLAIN = "plain"
MANNERS = ("whisper", "shout", "mumble")
"""The manners of speaking beside the usual one, ``PLAIN``."""
_NAMES = (NEUTRAL, *MOODS, PLAIN, *MANNERS)
_NUMBER = r"([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[-+]?[0-9]+)?)"
_KEY = re.compile(rf"([a-z]+)(?::{_NUMBER})?(?:\s+at\s+{_NUMBER})?", re.IGNORECASE)


@dataclass(frozen=True)
class MoodKey:
    """A mood that a face goes over to at a time, or a manner of speaking, and keeps until the next one of its kind.

    time_s   : seconds in the recording
    mood     : one of ``MOODS``, or ``NEUTRAL``; or one of ``MANNERS``, or ``PLAIN``
    strength : 0 to 1
    Raises InputError: no such mood, or a value out of its range.

    >>> str(MoodKey(1.2, "happy", 0.7))
    'happy:0.7 at 1.2'
    """

    time_s: float
    mood: str
    strength: float = 1.0

    def __post_init__(self) -> None:
        if self.mood not in _NAMES:
            near = get_close_matches(self.mood, _NAMES, 1)
            hint = f" (is it {near[0]}?)" if near else ""
            raise InputError(f"the mood is {shorten(repr(self.mood))}{hint}, required one of: {', '.join(_NAMES)}")
        if not 0 <= self.strength <= 1:
            raise InputError(f"the strength of the mood {self.mood} is {self.strength:g}, required 0 to 1")
        if not 0 <= self.time_s < float("inf"):
            raise InputError(f"the mood {self.mood} begins at {self.time_s:g} s, required 0 or more")

    @property
    def is_manner(self) -> bool:
        """Whether it is a manner of speaking."""
        return self.mood in (PLAIN, *MANNERS)

    @property
    def label(self) -> str:
        """The mood with its strength, as ``happy:0.7``."""
        return self.mood if self.strength == 1 else f"{self.mood}:{self.strength:g}"

    def __str__(self) -> str:
        return f"{self.label} at {self.time_s:.12g}"


@dataclass(frozen=True)
class MoodTag:
    """A mood that a tag in a text asks for.

    share    : of the words of the text that stand before it, 0 to 1
    mood, strength : as of ``MoodKey``
    """

    share: float
    mood: str
    strength: float = 1.0


def parse_moods(text: str) -> tuple[MoodKey, ...]:
    """Return the moods that a text states, in the order of their times; none for an empty text.

    text : ``MOOD``, ``MOOD:STRENGTH``, or several with their times in seconds: ``happy:0.7, sad at 2.5``
    Raises InputError: another form, or as ``MoodKey``.

    >>> parse_moods("sad at 2.5, happy:0.7")
    (MoodKey(time_s=0.0, mood='happy', strength=0.7), MoodKey(time_s=2.5, mood='sad', strength=1.0))
    """
    found = []
    for part in filter(None, map(str.strip, text.split(","))):
        key = _KEY.fullmatch(part)
        if key is None:
            raise InputError(
                f"the mood is {shorten(repr(part))}, required MOOD, MOOD:STRENGTH or MOOD:STRENGTH at SECONDS, "
                "as happy:0.7 at 2.5; several with commas"
            )
        found.append(MoodKey(float(key[3] or 0.0), key[1].lower(), float(key[2] or 1.0)))
    return sort_moods(found)


def format_moods(keys: Iterable[MoodKey]) -> str:
    """Return moods as the text that ``parse_moods`` reads."""
    return ", ".join(map(str, keys))


def sort_moods(keys: Sequence[MoodKey]) -> tuple[MoodKey, ...]:
    """Return moods and manners in the order of their times; of several of a kind at one time the last."""
    latest = {(key.time_s, key.is_manner): key for key in keys}
    return tuple(latest[place] for place in sorted(latest))
