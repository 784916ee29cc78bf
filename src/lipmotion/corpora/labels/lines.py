"""Labels a line: HTK, Audacity."""

from __future__ import annotations

import math
import re

from lipmotion.corpora.labels.tier import Label, Tier, check_count
from lipmotion.errors import InputError

TICKS_PER_S = 10_000_000
"""HTK counts in 100 ns."""
SHORTEST_TICKS = 10_000
"""Whole numbers under a millisecond are not times: "20 30 people" is a sentence."""
WHOLE = re.compile(r"(\d{1,18})\s+(\d{1,18})\s+(\S+)(?:\s.*)?")
STARTS = re.compile(r"(\d{1,18})\s+([^\d\s]\S*)")
SECONDS = re.compile(r"([-+]?\d*\.\d+)\s+([-+]?\d*\.\d+)(?:\s+(.*))?")


def timed_lines(text: str, where: str) -> Tier | None:
    """Return the labels of a file whose lines hold times, or None if they do not.

    HTK's ``start end label`` in 100 ns (further columns are passed over), or ``start label``, a label then lasting to
    the next one's start; Audacity's ``start end label`` in seconds.  The first line decides which.
    Raises InputError: a later line is of another form, with its number.
    """
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), 1)]
    lines = [(number, line) for number, line in lines if line and not line.startswith("\\")]  # Audacity's pitch ranges
    if not lines:
        return None
    first = lines[0][1]
    if SECONDS.fullmatch(first):
        return _spans(lines, SECONDS, 1, where)
    whole = WHOLE.fullmatch(first)
    if whole and int(whole[2]) >= SHORTEST_TICKS:
        return _spans(lines, WHOLE, TICKS_PER_S, where)
    last = STARTS.fullmatch(lines[-1][1])
    if len(lines) > 1 and STARTS.fullmatch(first) and last and int(last[1]) >= SHORTEST_TICKS:
        return _from_starts(lines, where)
    return None


def _spans(lines: list[tuple[int, str]], form: re.Pattern[str], per_s: int, where: str) -> Tier:
    check_count(len(lines), where)
    labels = []
    for number, line in lines:
        start, end, text = _fitted(form, number, line, "start end label", where)
        labels.append(Label(float(start) / per_s, float(end) / per_s, (text or "").strip(), f"line {number}"))
    return Tier("the list of labels", tuple(labels))


def _from_starts(lines: list[tuple[int, str]], where: str) -> Tier:
    check_count(len(lines), where)
    rows = [(number, _fitted(STARTS, number, line, "start label", where)) for number, line in lines]
    starts_s = [int(row[0]) / TICKS_PER_S for _, row in rows]
    ends_s = [*starts_s[1:], math.inf]
    return Tier(
        "the list of labels",
        tuple(
            Label(start_s, end_s, row[1], f"line {number}")
            for (number, row), start_s, end_s in zip(rows, starts_s, ends_s, strict=True)
        ),
    )


def _fitted(form: re.Pattern[str], number: int, line: str, wanted: str, where: str) -> tuple[str, ...]:
    match = form.fullmatch(line)
    if match is None:
        raise InputError(f"{where}: line {number} is {line[:60]!r}; required, as in line 1: {wanted}")
    return match.groups()
