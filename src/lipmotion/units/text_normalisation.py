"""A text as people write it: its sentences, the words that are spoken, and how long it may be."""

from __future__ import annotations

import html
import re
import unicodedata
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

from lipmotion.errors import AlignmentError, InputError, shorten
from lipmotion.units.lexicon import SOUNDED, expand_lengthened, list_entries
from lipmotion.units.spelling import ACCENTS, convert_to_plain, normalise_text, read_patterns
from lipmotion.units.written_forms import FORMS, NUMERIC, PIECES, WORD, list_readings

CHINESE = "[\u3400-\u4dbf\u4e00-\u9fff]"
MARKS = read_patterns(Path(__file__).with_name("tables") / "text_forms.tsv")
"""Patterns of texts as people write them, by their names in the table."""
CHARACTERS_PER_S = 200
"""Most characters a second: three times the fastest speech on record (655 words a minute), blanks and punctuation."""
ALWAYS_ALLOWED_CHARACTERS = 10_000
"""Characters that a text may always have, as notes and blank lines beside the words of a short recording."""
LARGEST_TRANSCRIPT_BYTES = 1 << 22  # most bytes of a transcript file: three days of speech
PHONES_PER_S = 100  # most phones a second: with more, a phone has less than one frame of 10 ms on average
ALWAYS_ALLOWED_PHONES = 1000
"""Phones that a list may always have; if they are those of another recording, a warning is enough."""
MAX_CHARACTERS = 50_000  # most characters of a text: about an hour of speech
LONGEST_SENTENCE = 400  # a longer sentence is divided at a comma, else between words; in characters
LONGEST_WORD = 200
"""Most characters without a blank in scripts that have blanks; a longer one is no word, but would take minutes."""
_ABBREVIATED = frozenset(
    "mr mrs ms dr prof st jr sr vs etc no vol fig inc ltd co gen col capt lt sgt rev hon e.g i.e a.m p.m approx".split()
)
"""What ends in a full stop that does not end a sentence, without its last stop."""


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
    text = MARKS["SMILEY"].sub(" ", MARKS["REFERENCE"].sub(lambda match: html.unescape(match[0]), text))
    text = re.sub(r"\bWW(?=II?\b)", "World War ", re.sub("№ ?", "No. ", text))
    plain = re.sub(
        r"\b(?:[ACS]|US|CA|AU|NZ|HK|NT|SG|MX)(?=\$)",
        "",
        MARKS["RANGE"].sub("–", ACCENTS.sub("", convert_to_plain(text))),
    )
    plain = re.sub(r"([$£€])-(?=\d)", r"-\1", plain)
    plain = MARKS["QUOTED"].sub(r"\2 ", plain)
    for form in (MARKS["COMMA"], MARKS["EUROS"]):
        plain = form.sub(lambda number: f"{number[1].replace('.', '')}.{number[2]}", plain)
    plain = MARKS["CURRENCY"].sub(lambda match: dict(zip("UEGIRJ", "$€£₹₹¥", strict=True))[match[0].strip()[0]], plain)
    plain = MARKS["GROUPED"].sub(lambda match: re.sub(r"\D", ",", match[0]), plain)
    shouted = not any(letter.islower() for letter in plain)
    tokens = []
    for token in (match[0] for match in _scanner().finditer(plain)):
        is_word = token.isalpha() or ("'" in token and token.replace("'", "").isalpha())
        name = token.lower()
        is_short = not shouted and MARKS["INITIALS"].fullmatch(token) is not None
        if is_short and not re.fullmatch(PIECES["LETTERS"], token):
            is_short = not (list_entries(name) or expand_lengthened(name) or SOUNDED.fullmatch(name))
        tokens.append(name if is_word and not is_short else token)
    return tuple(tokens)


@cache
def _scanner() -> re.Pattern[str]:
    # most are words and no more (but "XIX century"); the rest takes a tenfold time
    word = rf"(?!(?-i:[IVX]+) c){WORD}(?=[,;!?]|\s+(?-i:[a-z])|\s*\Z)"
    forms = [rf"(?:{form})(?:'s)?(?![^\W_])" for form, _ in FORMS[:-1]]  # initials are words
    numeric, worded = ("|".join(part) for part in (forms[: len(NUMERIC)], forms[len(NUMERIC) :]))
    signs = r"(?<!\w)w/o?(?=[\s.,;!?]|\Z)|[&@×÷≥≤≠§]|[+=](?![+=])(?<![+=]{2})|#(?=\w)|[~≈±](?=\d)"
    signs += r"|(?<![\w<>-])[<>](?=[$£€]?\d)|(?<=\d )[<>](?= \d)"
    after = r"(?:(?<=\d)|(?<=[\d ][a-z%])|(?<=[\d ][a-z]{2})|(?<=[a-z]{3}s)(?=/(?:min|sec|h|day|week|month|year)))"
    rates = rf"{after}/{PIECES['PER']}\b"
    dashes = r"(?<![^\s(])-(?=[.$£€]?\d)|−(?=\d)|(?<=[mdht\d%.])–(?=[$£€]?\d)"
    begun = rf"(?<![^\W_])(?:{word}|(?=[^\W\d_])(?:{worded})|(?![\s,;!?])(?:{numeric}))"
    grouped = "|".join([begun, rates, signs, dashes, WORD, r"\d+(?:\.\d+)*"])
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
        what = f"the transcript has {len(text)} characters, required at most {allowed} for {duration_s:.2f} s of sound:"
        raise AlignmentError(f"{what} nobody says so much; give the words of this recording")


def check_phones(count: int, duration_s: float) -> None:
    """Raise InputError for more phones in time than there are frames in this duration."""
    allowed = ALWAYS_ALLOWED_PHONES + int(PHONES_PER_S * duration_s)
    if count > allowed:
        what = f"{count} units in time, required at most {allowed} for {duration_s:.2f} s of sound;"
        raise InputError(f"{what} give those of this recording")


def clean_text(text: str) -> str:
    """Return a text without control characters and surrogates; an empty line ends a sentence."""
    ended = re.sub(r"(\w)[ \t]*\r?\n[ \t]*\r?\n", r"\1.\n", text)
    spoken = (" " if unicodedata.category(c) in ("Cc", "Cs", "Co", "Cn", "Zl", "Zp") else c for c in ended)
    return " ".join("".join(spoken).split())


def split_sentences(text: str) -> list[str]:
    """Return the sentences of a text, in order, each with a word in it and of at most ``LONGEST_SENTENCE`` characters.

    What stands between two sentences without a word, such as a row of dots, is left out.
    Raises InputError: more than ``MAX_CHARACTERS``, no word, or a word of more than ``LONGEST_WORD`` characters.

    >>> split_sentences("Dr. Smith said: wait! Then he left...")
    ['Dr. Smith said: wait!', 'Then he left...']
    """
    if len(text) > MAX_CHARACTERS:
        what = f"the text has {len(text)} characters, required at most {MAX_CHARACTERS}, about an hour of speech;"
        raise InputError(f"{what} speak it in parts")
    plain = clean_text(text)
    longest = max(plain.split(), key=len, default="")
    if len(longest) > LONGEST_WORD and longest.isascii():
        what = f"a word of {len(longest)} characters ({shorten(longest)!r}), required at most {LONGEST_WORD};"
        raise InputError(f"{what} write words with blanks between them")
    parts = []
    for sentence in _divide(plain):
        rest = sentence
        while len(rest) > LONGEST_SENTENCE:
            breaks = [match.end() for match in MARKS["BREAK"].finditer(rest, LONGEST_SENTENCE // 2, LONGEST_SENTENCE)]
            blank = rest.rfind(" ", 1, LONGEST_SENTENCE)
            cut = breaks[-1] if breaks else blank if blank > 0 else LONGEST_SENTENCE
            parts.append(rest[:cut].strip())
            rest = rest[cut:].strip()
        parts.append(rest)
    sentences = [part for part in parts if find_words(part)]
    if not sentences:
        raise InputError(f"the text {shorten(plain)!r} holds no word; give the words to be spoken")
    return sentences


def _divide(text: str) -> Iterator[str]:
    start = 0
    for end in MARKS["END"].finditer(text):
        before = text[start : end.start()].rsplit(" ", maxsplit=1)[-1].lstrip("\"'(“‘«")
        is_initial = len(before) == 1 and before.isalpha() and before.isupper() and before != "I"
        if text[end.start()] == "." and (before.lower() in _ABBREVIATED or is_initial):
            continue
        yield text[start : end.end()].strip()
        start = end.end()
    yield text[start:].strip()
