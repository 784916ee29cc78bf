"""Label files with one label a line: HTK's and Audacity's."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from io import StringIO
from itertools import islice

from lipmotion.corpora.labels.tier import MOST_LABELS, LabelTier, TimedLabel, check_count, required_time
from lipmotion.errors import InputError

TICKS_PER_S = 10_000_000
"""HTK's unit of time is 100 ns."""
SHORTEST_TICKS = 10_000
"""Whole numbers below a millisecond are not taken as times: "20 30 people" is a sentence."""
WHOLE = re.compile(r"(\d+)\s+(\d+)\s+(\S+)(?:\s.*)?")
STARTS = re.compile(r"(\d+)\s+([^\d\s]\S*)")
SECONDS = re.compile(r"([-+]?\d*\.\d+)\s+([-+]?\d*\.\d+)(?:\s+(.*))?")


def parse_timed_lines(text: str, where: str) -> LabelTier | None:
    """Return the labels of a text whose lines hold times, or None if they do not.

    HTK's lines are ``start end label`` in 100 ns (further columns are ignored), or ``start label``, where each label
    ends where the next one starts; Audacity's are ``start end label`` in seconds. The first line decides which.
    Raises InputError: a later line is of another form, with its number.
    """
    first = next((line for _, line in _lines(text)), "")
    if SECONDS.fullmatch(first):
        return _spans(_listed(text, where), SECONDS, 1, where)
    whole = WHOLE.fullmatch(first)
    if whole and float(whole[2]) >= SHORTEST_TICKS:
        return _spans(_listed(text, where), WHOLE, TICKS_PER_S, where)
    if not STARTS.fullmatch(first):
        return None
    lines = _listed(text, where)
    last = STARTS.fullmatch(lines[-1][1])
    return _from_starts(lines, where) if len(lines) > 1 and last and float(last[1]) >= SHORTEST_TICKS else None


def _lines(text: str) -> Iterator[tuple[int, str]]:
    """Yield number and text of every line, except blank ones and Audacity's pitch ranges."""
    for number, line in enumerate(StringIO(text), 1):
        stripped = line.strip()
        if stripped and not stripped.startswith("\\"):
            yield number, stripped


def _listed(text: str, where: str) -> list[tuple[int, str]]:
    lines = list(islice(_lines(text), MOST_LABELS + 1))
    check_count(len(lines), where)
    return lines


def _spans(lines: list[tuple[int, str]], form: re.Pattern[str], per_s: int, where: str) -> LabelTier:
    labels = []
    for number, line in lines:
        start, end, text = _fitted(form, number, line, "start end label", where)
        place = f"line {number}"
        start_s, end_s = (required_time(time, place, where) / per_s for time in (start, end))
        labels.append(TimedLabel(start_s, end_s, (text or "").strip(), place))
    return LabelTier("the list of labels", tuple(labels))


def _from_starts(lines: list[tuple[int, str]], where: str) -> LabelTier:
    rows = [(number, _fitted(STARTS, number, line, "start label", where)) for number, line in lines]
    starts_s = [required_time(row[0], f"line {number}", where) / TICKS_PER_S for number, row in rows]
    ends_s = [*starts_s[1:], math.inf]
    return LabelTier(
        "the list of labels",
        tuple(
            TimedLabel(start_s, end_s, row[1], f"line {number}")
            for (number, row), start_s, end_s in zip(rows, starts_s, ends_s, strict=True)
        ),
    )


def _fitted(form: re.Pattern[str], number: int, line: str, wanted: str, where: str) -> tuple[str, ...]:
    match = form.fullmatch(line)
    if match is None:
        raise InputError(f"{where}: line {number} is {line[:60]!r}; required, as in line 1: {wanted}")
    return match.groups()
