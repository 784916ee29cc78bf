"""Text to be spoken: cleaned, and divided into sentences that a synthesiser takes one at a time."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator

from lipmotion.errors import InputError, shorten
from lipmotion.units.text_normalisation import find_words

MOST_CHARACTERS = 50_000
"""Most characters of a text: about an hour of speech."""
LONGEST_SENTENCE = 400
"""A longer sentence is divided at a comma, else between words; in characters."""
LONGEST_WORD = 200
"""Most characters without a blank in scripts that have blanks; a longer one is no word, but would be spoken for
minutes."""
ABBREVIATIONS = (
    "mr mrs ms dr prof st jr sr vs etc no vol fig inc ltd co gen col capt lt sgt rev hon e.g i.e a.m p.m approx"
)
"""What ends in a full stop that does not end a sentence, without its last stop."""
_ABBREVIATED = frozenset(ABBREVIATIONS.split())
_END = re.compile(r"""(?:[.!?…]+["')\]”’»]*(?=\s)|[。！？]+["')\]”’»」』]*)\s*""")
_BREAK = re.compile(r"[,;:–—、，；：]\s*|\s-+\s")


def clean_text(text: str) -> str:
    """Return a text without what nobody can say: control characters and lone surrogates become blanks.

    An empty line ends a sentence, as a full stop does.
    """
    ended = re.sub(r"(\w)[ \t]*\r?\n[ \t]*\r?\n", r"\1.\n", text)
    return " ".join(
        "".join(" " if unicodedata.category(c) in ("Cc", "Cs", "Co", "Cn", "Zl", "Zp") else c for c in ended).split()
    )


def split_sentences(text: str) -> list[str]:
    """Return the sentences of a text, in order, each with a word in it and of at most ``LONGEST_SENTENCE`` characters.

    What stands between two sentences without a word, such as a row of dots, is left out.
    Raises InputError: more than ``MOST_CHARACTERS``, no word, or a word of more than ``LONGEST_WORD`` characters.

    >>> split_sentences("Dr. Smith said: wait! Then he left...")
    ['Dr. Smith said: wait!', 'Then he left...']
    """
    if len(text) > MOST_CHARACTERS:
        raise InputError(
            f"the text has {len(text)} characters, required at most {MOST_CHARACTERS}, about an hour of speech; "
            "speak it in parts"
        )
    plain = clean_text(text)
    longest = max(plain.split(), key=len, default="")
    if len(longest) > LONGEST_WORD and longest.isascii():
        raise InputError(
            f"a word of {len(longest)} characters ({shorten(longest)!r}), required at most {LONGEST_WORD}; "
            "write words with blanks between them"
        )
    found = [part for sentence in _ended(plain) for part in _short(sentence) if find_words(part)]
    if not found:
        raise InputError(f"the text {shorten(plain)!r} holds no word; give the words to be spoken")
    return found


def _ended(text: str) -> Iterator[str]:
    """Yield the sentences of a text as punctuation divides it."""
    start = 0
    for end in _END.finditer(text):
        before = text[start : end.start()].rsplit(" ", maxsplit=1)[-1].lstrip("\"'(“‘«")
        is_initial = len(before) == 1 and before.isalpha() and before.isupper() and before != "I"
        if text[end.start()] == "." and (before.lower() in _ABBREVIATED or is_initial):
            continue
        yield text[start : end.end()].strip()
        start = end.end()
    yield text[start:].strip()


def _short(sentence: str) -> Iterator[str]:
    """Yield a sentence in parts of at most ``LONGEST_SENTENCE`` characters."""
    while len(sentence) > LONGEST_SENTENCE:
        breaks = [found.end() for found in _BREAK.finditer(sentence, LONGEST_SENTENCE // 2, LONGEST_SENTENCE)]
        blank = sentence.rfind(" ", 1, LONGEST_SENTENCE)
        cut = breaks[-1] if breaks else blank if blank > 0 else LONGEST_SENTENCE
        yield sentence[:cut].strip()
        sentence = sentence[cut:].strip()
    yield sentence
