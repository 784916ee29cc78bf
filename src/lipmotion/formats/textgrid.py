"""``.TextGrid``: labels of Praat in time, written in long text form, read in long and short form.

Written are the tiers ``phones`` and ``words``. Source: Praat manual, "TextGrid file formats".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from lipmotion.errors import InputError, shorten
from lipmotion.formats.label_tiers import LabelTier, TimedLabel, check_count, find_tier, require_time
from lipmotion.storage.files import atomic_file
from lipmotion.types import Timeline, Unit
from lipmotion.units import RECOGNISED, group_words, list_recognised_phones

TOKEN = re.compile(
    r'"(?P<text>[^"]*)"|![^\n]*|<(?P<flag>\w+)>|(?<!\S)(?P<number>[-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)(?!\S)'
)
"""What Praat itself reads: texts in quotes, flags, and numbers between blanks. All else (``xmin =``) is ignored."""
TEXTGRID = re.compile(r'\s*(?:![^\n]*\n\s*)*(?:(?:File type\s*=\s*)?"?oo(?:Text|Binary)File|"Praat chronological)')
"""How Praat's files begin, perhaps after comments."""
INTERVALS, POINTS = "IntervalTier", "TextTier"


class _DamagedError(Exception):
    """The file ends too early, or another token was expected."""


def parse_interval_tiers(text: str, where: str) -> list[LabelTier]:
    """Return the interval tiers of a TextGrid; point tiers are ignored. Raises InputError: not a whole TextGrid."""
    tokens = _tokens(text)
    tiers: list[LabelTier] = []
    total = 0
    place = "the header"
    try:
        if "chronological" in _take(tokens, "text"):
            raise InputError(f"{where}: a TextGrid in order of time; save it as a text file in Praat")
        if _take(tokens, "text") != "TextGrid":
            raise InputError(f"{where}: a Praat file of another kind; save a TextGrid")
        _take(tokens, "number"), _take(tokens, "number")  # from when to when it lasts
        tier_count = _count(tokens) if _take(tokens, "flag") == "exists" else 0
        for number in range(1, tier_count + 1):
            place = f"tier {number}"
            kind, name = _take(tokens, "text"), _take(tokens, "text")
            place = f"tier {shorten(name)!r}"
            _take(tokens, "number"), _take(tokens, "number")
            count = _count(tokens)
            total += count
            check_count(total, where)
            if count and kind not in (INTERVALS, POINTS):
                raise _DamagedError(f"its kind is {shorten(kind)!r}, required {INTERVALS} or {POINTS}")
            labels = []
            for position in (f"{place}, interval {i + 1}" for i in range(count)):
                start_s = require_time(_take(tokens, "number"), position, where)
                end_s = require_time(_take(tokens, "number"), position, where) if kind == INTERVALS else start_s
                labels.append(TimedLabel(start_s, end_s, _take(tokens, "text").replace('""', '"').strip(), position))
            tiers += [find_tier(name, labels)] if kind == INTERVALS else []
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
            # a quote that is written twice is one in the text
            while text[at : at + 1] == '"' and (closing := text.find('"', at + 1)) > 0:
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


def write_textgrid(path: Path, units: Timeline[Unit]) -> None:
    """Write phones in time to a TextGrid in long text form, with the tiers ``phones`` and ``words``.

    Where a label has no phone, the name of its unit is written. Words are those of ``units.group_words``. Recognised
    phones are in a third tier, ``recognised``, with their confidence (``p 0.37``), so that a reader can tell them from
    corrected ones. Times are as exact as floats are. After a failure there is no partial file.
    Raises ExportError: the file cannot be written.
    """
    phones = [(float(span.start_s), float(span.end_s), span.label.phone or span.label.unit) for span in units]
    words = [(float(span.start_s), float(span.end_s), span.label) for span in group_words(units)]
    tiers = [("phones", phones), ("words", words)]
    recognised = [(p.start_s, p.end_s, f"{p.name} {p.confidence}") for p in list_recognised_phones(units)]
    if recognised:
        tiers.append((RECOGNISED, recognised))
    end_s = max((float(span.end_s) for span in units), default=0.0)
    lines = ['File type = "ooTextFile"', 'Object class = "TextGrid"', "", "xmin = 0", f"xmax = {end_s}"]
    lines += ["tiers? <exists>", f"size = {len(tiers)}", "item []:"]
    for number, (name, intervals) in enumerate(tiers, 1):
        filled = list[tuple[float, float, str]]()  # and gaps: Praat requires intervals that follow each other
        reached_s = 0.0
        for start_s, stop_s, text in [*intervals, (end_s, end_s, "")]:
            filled += [(reached_s, start_s, "")] if start_s > reached_s else []
            filled.append((max(reached_s, start_s), stop_s, text))
            reached_s = stop_s
        filled.pop()
        lines += [f"    item [{number}]:", '        class = "IntervalTier"', f'        name = "{name}"']
        lines += ["        xmin = 0", f"        xmax = {end_s}", f"        intervals: size = {len(filled)}"]
        for place, (start_s, stop_s, text) in enumerate(filled, 1):
            quoted = text.replace('"', '""')
            lines += [f"        intervals [{place}]:", f"            xmin = {start_s}", f"            xmax = {stop_s}"]
            lines.append(f'            text = "{quoted}"')
    with atomic_file(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
