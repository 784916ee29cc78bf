"""Takes of Live Link Face for Blender, read as the library reads them. Runs inside Blender: no imports of lipmotion,
nothing but the standard library.
"""

from __future__ import annotations

import math
import re

TIMECODE_RATES = (24, 25, 30, 48, 50, 60, 120)
APP_RATE = 60
"""Frames a second of the timecode where a take does not show it."""
DAY_S = 86_400.0
BACKWARDS_S = 0.5
"""A row that is earlier than one before by less than this is left out; more is an error."""
_TIMECODE = re.compile(r"(\d{1,2}):(\d{1,2}):(\d{1,2})([:;.])(\d{1,3}(?:\.\d{1,9})?|\d{1,9})", re.ASCII)


def read_take(rows: list[list[str]]) -> tuple[list[str], list[float], list[list[float]]]:
    """Return the names of the curves of a take, the times of its rows from the first one in seconds, and their values.

    rows : the fields of its lines, the first of them the names
    Rows without a face (a count of 0, or empty fields) are left out: what is between others is a straight line; before
    the first face and after the last one all is at rest.
    Raises ValueError: a row with too few curves, no timecode, timecodes that go back, or no values.
    """
    counted = len(rows[0]) > 1 and rows[0][1].strip().lower() == "blendshapecount"
    skipped = 2 if counted else 1
    names = [name.strip() for name in rows[0][skipped:]]
    while names and not names[-1]:
        names.pop()
    times = timecode_seconds([row[0].strip() for row in rows[1:]])
    seen_s: list[float] = []
    rows_seen: list[list[float]] = []
    latest = -math.inf
    for number, (row, time_s) in enumerate(zip(rows[1:], times), 2):  # noqa: B905
        if latest - time_s > BACKWARDS_S:
            raise ValueError(f"the timecode of row {number} goes back by {latest - time_s:.2f} s")
        ordered, latest = time_s > latest, max(latest, time_s)
        values = _values(row, skipped, len(names), number) if ordered else []
        if values:
            seen_s.append(time_s)
            rows_seen.append(values)
    if not rows_seen:
        raise ValueError("the take has no rows with values")
    rest = [0.0] * len(names)
    before = [time_s for time_s in times if time_s < seen_s[0]]
    after = [time_s for time_s in times if time_s > seen_s[-1]]
    seen_s = [*before[:1], *before[1:][-1:], *seen_s, *after[:1], *after[1:][-1:]]
    rows_seen = [*[rest] * len(before[:2]), *rows_seen, *[rest] * len(after[:2])]
    return names, [time_s - seen_s[0] for time_s in seen_s], rows_seen


def timecode_seconds(codes: list[str]) -> list[float]:
    """Return timecodes as seconds since the midnight before the first.

    ``HH:MM:SS:FF.mmm`` counts frames, of which as many make a second as the take shows; ``HH:MM:SS;FF`` is drop-frame
    (numbers 0 and 1 are left out in every minute but each tenth, SMPTE 12M); after ``.`` follow parts of a second.
    Raises ValueError: not a timecode.
    """
    matches = [_TIMECODE.fullmatch(code) for code in codes]
    parts = [(int(each[1]) * 3600 + int(each[2]) * 60 + int(each[3]), each[4], each[5]) for each in matches if each]
    if len(parts) < len(codes):
        raise ValueError(f"{codes[matches.index(None)]!r} is no timecode as 12:30:59:29.500")
    if not parts:
        return []
    mark = parts[0][1]
    times: list[float] = []
    frames = [float(f"0.{text.replace('.', '')}" if sign == "." else text) for _, sign, text in parts]
    rate = 1
    if mark != ".":  # as many frames make a second as the take shows
        passed = [number for number in range(len(parts) - 1) if parts[number + 1][0] - parts[number][0] == 1]
        last = int(max([frames[number] for number in passed] if len(passed) == 1 else frames))
        if last >= TIMECODE_RATES[-1]:
            raise ValueError(f"a timecode has frame {last}, required less than {TIMECODE_RATES[-1]}")
        shown = next(rate for rate in TIMECODE_RATES if rate > last)
        rate = shown if passed else max(shown, APP_RATE)
    passed_s = 0.0
    for (seconds, *_), frame in zip(parts, frames):  # noqa: B905
        time_s = seconds + frame / rate
        if mark == ";":
            minutes = seconds // 60
            dropped = rate / 15 * (minutes - minutes // 10)
            time_s = (seconds * rate + frame - dropped) * 1001 / (1000 * rate)
        if times and time_s + passed_s - times[-1] < -DAY_S / 2:
            passed_s += DAY_S
        times.append(time_s + passed_s)
    return times


def _values(row: list[str], skipped: int, curves: int, number: int) -> list[float]:
    """Return the values of a row; none where no face was found."""
    fields = row[skipped:]
    while len(fields) > curves and not fields[-1].strip():
        fields.pop()
    if (skipped == 2 and row[1:2] == ["0"]) or not any(field.strip() for field in fields):
        return []
    if len(fields) != curves:
        raise ValueError(f"row {number} has {len(fields)} curves, required {curves}; delete it if it is the last")
    values = list(map(float, fields))
    return values if all(map(math.isfinite, values)) else []
