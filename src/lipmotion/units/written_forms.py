"""Written forms that are said as other words: ordinals, sums of money, ``%`` and ``&``."""

from __future__ import annotations

import re

ORDINAL = r"(?<!\w)\d{1,12}(?:st|nd|rd|th)(?![^\W_])"
"""``1st``, ``22nd``, in lower case."""
MONEY = re.compile(
    r"([$£€])\s?(\d{1,12})(?:\.(\d{1,2}))?(?![\w.,]*\d)(\s(?:hundred|thousand|million|billion|trillion)\b)?"
)
PERCENT = re.compile(r"(?<=\d)\s?%")
AND = re.compile(r"&(?!#?\w{1,8};)")
"""``&``, but not the start of a character reference (``&amp;``)."""
MONEY_NAMES = {
    "$": (("dollar", "dollars"), ("cent", "cents")),
    "£": (("pound", "pounds"), ("penny", "pence")),
    "€": (("euro", "euros"), ("cent", "cents")),
}
ORDINALS = {
    "one": "first",
    "two": "second",
    "three": "third",
    "five": "fifth",
    "eight": "eighth",
    "nine": "ninth",
    "twelve": "twelfth",
}
"""The ordinals that do not end in ``th`` after the cardinal."""


def ordinal_word(word: str) -> str:
    """Return the ordinal of the last word of a number: ``third`` of ``three``, ``twentieth`` of ``twenty``."""
    if word in ORDINALS:
        return ORDINALS[word]
    return f"{word[:-1]}ieth" if word.endswith("y") else f"{word}th"


def as_spoken(text: str) -> str:
    """Return a text in lower case with sums of money, ``%`` and ``&`` in the words and the order of speech.

    Numbers stay digits: ``$5.50`` becomes ``5 dollars and 50 cents``, ``7%`` ``7 percent``.
    """
    text = MONEY.sub(_money, text)
    return AND.sub(" and ", PERCENT.sub(" percent", text))


def _money(found: re.Match[str]) -> str:
    """Return a sum of money as it is said."""
    sign, whole, part, scale = found.groups()
    (one, many), (one_part, many_parts) = MONEY_NAMES[sign]
    if scale or len(part or "") == 1:
        fraction = f" point {' '.join(part)}" if part else ""
        return f" {whole}{fraction}{scale or ''} {many}"
    said = []
    if int(whole) or not int(part or 0):
        said.append(f"{whole} {one if int(whole) == 1 else many}")
    if int(part or 0):
        said.append(f"{int(part or 0)} {one_part if int(part or 0) == 1 else many_parts}")
    return f" {' and '.join(said)}"
