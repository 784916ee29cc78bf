"""Text normalisation: a transcript as people write it, to the words that are spoken; how long a text may be."""

from __future__ import annotations

import html
import re
import unicodedata
from collections.abc import Sequence
from functools import cache

from lipmotion.errors import AlignmentError, InputError
from lipmotion.units.lexicon import SOUNDED, expand_lengthened, in_dictionary
from lipmotion.units.spelling import normalise_text, plain_text
from lipmotion.units.written_forms import FORMS, NUMERIC, WORD, list_readings

CHINESE = "[\u3400-\u4dbf\u4e00-\u9fff]"
"""A Chinese character."""
INITIALS = re.compile("[A-Z]{2,5}s?")
"""What may be letters that are said one by one."""
RANGE = re.compile(
    r"(?:(?<=\d[ap]m)|(?<=\d [ap]m)|(?<=:\d\d))\s?[-–]\s?(?=\d)|(?<=\d)-(?=\d{1,2}\s?[ap]m\b)", re.IGNORECASE
)
"""The dash of ``9am-5pm`` and ``5:00-6:30``."""
GROUPED = re.compile(
    r"(?<![\w.,])(?<!\d )[1-9](?:\d{0,2}(?:(?:'\d{3})+|(?: \d{3})* 000)|\d?(?: \d{3}){2,})(?![\d']| \d)"
)
"""Numbers whose thousands are parted by blanks or apostrophes: ``1 000 000``, ``1'000'000``."""
SMILEY = re.compile(r"(?<!\w)(?:[:;=8][-o']?[)(\]DPpO3|/\\]+|<3+|[xX]D+|\^_+\^|[tT]_[tT])(?!\w)")
REFERENCE = re.compile(r"&(?:[a-zA-Z]{2,8}|#\d{1,6}|#x[\da-fA-F]{1,5});")
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


def split_words(text: str) -> tuple[str, ...]:
    """Return the lower-case words of a text: punctuation dropped, hyphens split, numbers and money as they are said."""
    return tuple(word for token in require_tokens(text) for word in list_readings(token)[0])


def find_words(text: str) -> tuple[str, ...]:
    """Return the words of a text as ``split_words`` does; none where there is none."""
    return tuple(word for token in tokenise(text) for word in list_readings(token)[0])


def require_tokens(text: str) -> tuple[str, ...]:
    """Return the words of a text as ``tokenise`` does. Raises InputError: there is no word in it."""
    return _require_words(tokenise(text), text)


def tokenise(text: str) -> tuple[str, ...]:
    """Return the words of a text in lower case, and what is said as other words as it is written.

    A lexicon pronounces these in all their readings (``units.written_forms``).

    >>> tokenise("Dr. Brown met Henry VIII at 5:00, in May 1995!")
    ('Dr.', 'brown', 'met', 'Henry VIII', 'at', '5:00', 'in', 'may', '1995')
    """
    text = SMILEY.sub(" ", REFERENCE.sub(lambda found: html.unescape(found[0]), text))
    plain = re.sub(r"\bUS(?=\$)", "", RANGE.sub("–", plain_text(re.sub("№ ?", "No. ", text))))
    plain = GROUPED.sub(lambda found: re.sub(r"\D", ",", found[0]), plain)
    shouted = not any(letter.islower() for letter in plain)
    tokens = []
    for token in (found[0] for found in _scanner().finditer(plain)):
        is_word = token.isalpha() or ("'" in token and token.replace("'", "").isalpha())
        is_short = not shouted and INITIALS.fullmatch(token) and not in_dictionary(token.lower())
        is_short = is_short and not (expand_lengthened(token.lower()) or SOUNDED.fullmatch(token.lower()))
        tokens.append(token.lower() if is_word and not is_short else token)
    return tuple(tokens)


@cache
def _scanner() -> re.Pattern[str]:
    """Return what finds written forms, signs, words, and numbers beside letters."""
    word = rf"{WORD}(?=[,;!?]|\s+(?-i:[a-z])|\s*\Z)"  # most are words and no more; the rest takes a tenfold time
    forms = [rf"(?:{form})(?![^\W_])" for form, _ in FORMS[:-1]]  # initials are words
    numeric, worded = ("|".join(part) for part in (forms[: len(NUMERIC)], forms[len(NUMERIC) :]))
    signs = r"(?<!\w)w/o?(?=[\s.,;!?]|\Z)|[&@×÷]|[+=](?![+=])(?<![+=]{2})|#(?=\w)|~(?=\d)"
    dashes = r"(?<![^\s(])-(?=[.$£€]?\d)|−(?=\d)|(?<=[m\d])–(?=\d)"
    begun = rf"(?<![^\W_])(?:{word}|(?=[^\W\d_])(?:{worded})|(?![\s,;!?])(?:{numeric}))"
    grouped = "|".join([begun, signs, dashes, WORD, r"\d+(?:\.\d+)*"])
    return re.compile(re.sub(r"(?<!\\)\((?!\?)", "(?:", grouped), re.IGNORECASE)


def split_written_words(text: str) -> tuple[str, ...]:
    """Return the lower-case words of a text in any language, as they are written: numbers in digits.

    A Chinese character is a word of its own, as no blanks divide them.
    Raises InputError: there is no word in it.
    """
    spaced = re.sub(CHINESE, r" \g<0> ", normalise_text(text))
    spoken = "".join(letter if letter == "'" or unicodedata.category(letter)[0] in "LMN" else " " for letter in spaced)
    return _require_words(tuple(word.strip("'") for word in spoken.split() if word.strip("'")), text)


def _require_words(words: tuple[str, ...], text: str) -> tuple[str, ...]:
    """Return words. Raises InputError: there is none."""
    if not words:
        raise InputError(f"the transcript {text[:40]!r} holds no word; give the words that are spoken")
    return words


def check_words(words: Sequence[str], duration_s: float) -> None:
    """Raise AlignmentError for words that nobody can say within this duration."""
    check_text("".join(f"{word} " for word in words), duration_s)


def check_text(text: str, duration_s: float) -> None:
    """Raise AlignmentError for a text that nobody can say within this duration."""
    allowed = ALWAYS_ALLOWED_CHARACTERS + int(CHARACTERS_PER_S * duration_s)
    if len(text) > allowed:
        raise AlignmentError(
            f"the transcript has {len(text)} characters, required at most {allowed} for {duration_s:.2f} s of sound: "
            "nobody says so much; give the words of this recording"
        )


def check_phones(count: int, duration_s: float) -> None:
    """Raise InputError for more phones in time than there are frames in this duration."""
    allowed = ALWAYS_ALLOWED_PHONES + int(PHONES_PER_S * duration_s)
    if count > allowed:
        raise InputError(
            f"{count} units in time, required at most {allowed} for {duration_s:.2f} s of sound; give those of this "
            "recording"
        )
