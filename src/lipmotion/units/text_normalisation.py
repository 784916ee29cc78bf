"""Text normalisation: a transcript as people write it, to the words that are spoken."""

from __future__ import annotations

import re
import unicodedata

from lipmotion.errors import InputError
from lipmotion.units.written_forms import ORDINAL, as_spoken, ordinal_word

ONES = (
    "zero one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen sixteen "
    "seventeen eighteen nineteen"
).split()
TENS = "_ _ twenty thirty forty fifty sixty seventy eighty ninety".split()
TOKEN = re.compile(rf"{ORDINAL}|[^\W\d_]+(?:'[^\W\d_]+)*|\d+")
"""An ordinal in digits, a word, or a whole number."""
CHINESE = "[\u3400-\u4dbf\u4e00-\u9fff]"
"""A Chinese character."""
MOST_MARKS = 30
"""Most accents on one letter; no language has so many."""
SCALES = ((10**9, "billion"), (10**6, "million"), (1000, "thousand"), (100, "hundred"))


def words_of(text: str) -> tuple[str, ...]:
    """Return the lower-case words of a text: punctuation dropped, hyphens split, numbers and money spelled out.

    Raises InputError: there is no word in it.
    """
    words = words_in(text)
    if not words:
        raise InputError(f"the transcript {text[:40]!r} holds no word; give the words that are spoken")
    return words


def words_in(text: str) -> tuple[str, ...]:
    """Return the words of a text as ``words_of`` does; none where there is none."""
    words: list[str] = []
    text = as_spoken(re.sub(r"(?<=\d),(?=\d{3})", "", normalised_text(text)))
    for token in TOKEN.findall(text):
        if token.isdecimal():
            words += number_words(token)
        elif token[0].isdecimal():
            *before, last = number_words(token[:-2])
            words += [*before, ordinal_word(last)]
        else:
            words.append(token)
    return tuple(words)


def written_words(text: str) -> tuple[str, ...]:
    """Return the lower-case words of a text in any language, as they are written: numbers in digits.

    A Chinese character is a word of its own, as no blanks divide them.
    Raises InputError: there is no word in it.
    """
    spaced = re.sub(CHINESE, r" \g<0> ", normalised_text(text))
    kept = "".join(letter if letter == "'" or unicodedata.category(letter)[0] in "LMN" else " " for letter in spaced)
    words = tuple(word.strip("'") for word in kept.split() if word.strip("'"))
    if not words:
        raise InputError(f"the transcript {text[:40]!r} holds no word; give the words that are spoken")
    return words


def normalised_text(text: str) -> str:
    """Return a text in lower case, in Unicode's NFKC form, with straight apostrophes."""
    return unicodedata.normalize("NFKC", _few_marks(text)).lower().replace("’", "'")


def _few_marks(text: str) -> str:
    """Return a text with at most ``MOST_MARKS`` marks on a letter: Unicode sorts them in quadratic time.

    Source: Unicode Standard Annex 15, Stream-Safe Text Format.
    """
    if text.isascii():
        return text
    marks = re.escape("".join(c for c in set(text) if unicodedata.combining(unicodedata.normalize("NFKD", c)[0])))
    return re.sub(f"([{marks}]{{{MOST_MARKS}}})[{marks}]+", r"\1", text) if marks else text


def number_words(digits: str) -> list[str]:
    """Return the words of a whole number; from a trillion on, or with leading zeros, digit by digit."""
    if len(digits) > 12 or (len(digits) > 1 and digits[0] == "0"):
        return [ONES[int(digit)] for digit in digits]
    number = int(digits)
    if number < 20:
        return [ONES[number]]
    if number < 100:
        return [TENS[number // 10], *([ONES[number % 10]] if number % 10 else [])]
    scale, name = next((scale, name) for scale, name in SCALES if number >= scale)
    rest = number_words(str(number % scale)) if number % scale else []
    return [*number_words(str(number // scale)), name, *rest]
