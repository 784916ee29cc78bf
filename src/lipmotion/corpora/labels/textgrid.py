"""Praat TextGrids, long and short text form."""

from __future__ import annotations

import re
from collections.abc import Iterator

from lipmotion.corpora.labels.tier import Label, Tier, check_count
from lipmotion.errors import InputError

TOKEN = re.compile(
    r'"(?P<text>[^"]*(?:""[^"]*)*)"|![^\n]*|<(?P<flag>\w+)>|(?<!\S)(?P<number>[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?)(?!\S)'
)
"""What Praat itself reads: texts in quotes, flags, numbers that stand alone. All else (``xmin =``) is decoration."""
MARK = re.compile(r'\s*(?:File type\s*=\s*)?"?oo(Text|Binary)File')
LONGEST_COUNT = 18
"""Digits of a count."""
INTERVALS, POINTS = "IntervalTier", "TextTier"


class _DamagedError(Exception):
    """The file ends too early, or holds something else than is wanted."""


def is_textgrid(text: str) -> bool:
    """Whether a text begins as Praat's files do."""
    return MARK.match(text) is not None


def interval_tiers(text: str, where: str) -> list[Tier]:
    """Return the interval tiers of a TextGrid; point tiers are passed over.

    where : the file's name, for messages
    Raises InputError: not a whole TextGrid.
    """
    tokens = _tokens(text)
    tiers: list[Tier] = []
    total = 0
    place = "the header"
    try:
        _take(tokens, "text")
        if _take(tokens, "text") != "TextGrid":
            raise InputError(f"{where}: a Praat file of another kind; save a TextGrid")
        _pass_range(tokens)
        tier_count = _count(tokens) if _take(tokens, "flag") == "exists" else 0
        for number in range(1, tier_count + 1):
            place = f"tier {number}"
            kind, name = _take(tokens, "text"), _take(tokens, "text")
            place = f"tier {name!r}"
            _pass_range(tokens)
            count = _count(tokens)
            total += count
            check_count(total, where)
            labels = [_label(tokens, kind, f"{place}, interval {i + 1}") for i in range(count)]
            if kind == INTERVALS:
                tiers.append(Tier(place, tuple(labels)))
    except _DamagedError as error:
        raise InputError(f"{where}: {place} is damaged: {error}; save it again in Praat") from error
    return tiers


def _tokens(text: str) -> Iterator[tuple[str, str]]:
    for match in TOKEN.finditer(text):
        if match.lastgroup:
            yield match.lastgroup, match[match.lastgroup]


def _label(tokens: Iterator[tuple[str, str]], kind: str, place: str) -> Label:
    if kind not in (INTERVALS, POINTS):
        raise _DamagedError(f"its kind is {kind!r}, required {INTERVALS} or {POINTS}")
    start_s = float(_take(tokens, "number"))
    end_s = float(_take(tokens, "number")) if kind == INTERVALS else start_s
    return Label(start_s, end_s, _take(tokens, "text").replace('""', '"').strip(), place)


def _pass_range(tokens: Iterator[tuple[str, str]]) -> None:
    """Pass over where a file or a tier begins and ends."""
    for _ in range(2):
        _take(tokens, "number")


def _count(tokens: Iterator[tuple[str, str]]) -> int:
    value = _take(tokens, "number")
    if not value.isdecimal() or len(value) > LONGEST_COUNT:
        raise _DamagedError(f"there stands number {value[:40]}, required a count")
    return int(value)


def _take(tokens: Iterator[tuple[str, str]], wanted: str) -> str:
    kind, value = next(tokens, ("the end of the file", ""))
    if kind != wanted:
        raise _DamagedError(f"there stands {kind} {value[:40]}".rstrip() + f", required a {wanted}")
    return value
