"""Praat TextGrids, in long and short text form."""

from __future__ import annotations

import re
from collections.abc import Iterator

from lipmotion.corpora.labels.tier import LabelTier, TimedLabel, check_count, named_tier, required_time
from lipmotion.errors import InputError, shortened

TOKEN = re.compile(
    r'"(?P<text>[^"]*)"|![^\n]*|<(?P<flag>\w+)>|(?<!\S)(?P<number>[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?)(?!\S)'
)
"""What Praat itself reads: texts in quotes, flags, and numbers between blanks. All else (``xmin =``) is ignored."""
MARK = re.compile(r'\s*(?:File type\s*=\s*)?"?oo(Text|Binary)File')
INTERVALS, POINTS = "IntervalTier", "TextTier"


class _DamagedError(Exception):
    """The file ends too early, or another token was expected."""


def is_textgrid(text: str) -> bool:
    """Return whether a text begins as Praat's files do."""
    return MARK.match(text) is not None


def parse_interval_tiers(text: str, where: str) -> list[LabelTier]:
    """Return the interval tiers of a TextGrid; point tiers are ignored.

    where : the file's name, for messages
    Raises InputError: not a whole TextGrid.
    """
    tokens = _tokens(text)
    tiers: list[LabelTier] = []
    total = 0
    place = "the header"
    try:
        _take(tokens, "text")
        if _take(tokens, "text") != "TextGrid":
            raise InputError(f"{where}: a Praat file of another kind; save a TextGrid")
        _take(tokens, "number"), _take(tokens, "number")  # from when to when it lasts
        tier_count = _count(tokens) if _take(tokens, "flag") == "exists" else 0
        for number in range(1, tier_count + 1):
            place = f"tier {number}"
            kind, name = _take(tokens, "text"), _take(tokens, "text")
            place = f"tier {shortened(name)!r}"
            _take(tokens, "number"), _take(tokens, "number")
            count = _count(tokens)
            total += count
            check_count(total, where)
            if count and kind not in (INTERVALS, POINTS):
                raise _DamagedError(f"its kind is {shortened(kind)!r}, required {INTERVALS} or {POINTS}")
            labels = []
            for position in (f"{place}, interval {i + 1}" for i in range(count)):
                start_s = required_time(_take(tokens, "number"), position, where)
                end_s = required_time(_take(tokens, "number"), position, where) if kind == INTERVALS else start_s
                labels.append(TimedLabel(start_s, end_s, _take(tokens, "text").replace('""', '"').strip(), position))
            tiers += [named_tier(name, labels)] if kind == INTERVALS else []
        place = "what follows the last tier"
        if next(tokens, None) is not None:
            raise _DamagedError("more is there than the counts say")
    except _DamagedError as error:
        raise InputError(f"{where}: {place} is damaged: {error}; save it again in Praat") from error
    return tiers


def _tokens(text: str) -> Iterator[tuple[str, str]]:
    """Yield kind (text, flag, number) and value of every token."""
    at = 0
    while match := TOKEN.search(text, at):
        at = match.end()
        if match.lastgroup == "text":
            while (
                text[at : at + 1] == '"' and (closing := text.find('"', at + 1)) > 0
            ):  # written twice: one in the text
                at = closing + 1
            yield "text", text[match.start() + 1 : at - 1]
        elif match.lastgroup:
            yield match.lastgroup, match[match.lastgroup]


def _count(tokens: Iterator[tuple[str, str]]) -> int:
    value = _take(tokens, "number")
    if re.fullmatch("[0-9]{1,18}", value) is None:
        raise _DamagedError(f"there stands number {value[:40]}, required a count")
    return int(value)


def _take(tokens: Iterator[tuple[str, str]], wanted: str) -> str:
    """Return the value of the next token. Raises _DamagedError: it is of another kind."""
    kind, value = next(tokens, ("the end of the file", ""))
    if kind != wanted:
        raise _DamagedError(f"there stands {kind} {' '.join(value[:40].split())}".rstrip() + f", required a {wanted}")
    return value
