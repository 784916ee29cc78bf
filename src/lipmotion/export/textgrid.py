"""Phones in time as a TextGrid, which Praat and other label editors open."""

from __future__ import annotations

from pathlib import Path

from lipmotion.storage.files import whole_file
from lipmotion.types import Timeline, Unit
from lipmotion.units import RECOGNISED, recognised_phones, words_in_time

TEXTGRID_SUFFIX = ".TextGrid"
"""As Praat writes it; case does not matter."""
Interval = tuple[float, float, str]
"""Start and end in seconds, and the text."""


def write_textgrid(path: Path, units: Timeline[Unit]) -> None:
    """Write phones in time to a TextGrid in long text form, with the tiers ``phones`` and ``words``.

    units : the phones; where a label has no phone, the name of its unit is written
    Words are those of ``units.words_in_time``. If phones were recognised, a third tier, ``recognised``, holds these
    with their confidence (``p 0.37``), so that a reader can tell them from corrected ones (``units.recognised``).
    Times are as exact as floats are. After a failure there is no partial file.
    Raises ExportError: the file cannot be written.
    Source: Praat manual, "TextGrid file formats".
    """
    phones = [(float(span.start_s), float(span.end_s), span.label.phone or span.label.unit) for span in units]
    words = [(float(span.start_s), float(span.end_s), span.label) for span in words_in_time(units)]
    tiers = [("phones", phones), ("words", words)]
    recognised = [
        (phone.start_s, phone.end_s, f"{phone.name} {phone.confidence}") for phone in recognised_phones(units)
    ]
    if recognised:
        tiers.append((RECOGNISED, recognised))
    end_s = max((float(span.end_s) for span in units), default=0.0)
    lines = ['File type = "ooTextFile"', 'Object class = "TextGrid"', "", "xmin = 0", f"xmax = {end_s}"]
    lines += ["tiers? <exists>", f"size = {len(tiers)}", "item []:"]
    for number, (name, intervals) in enumerate(tiers, 1):
        lines += _tier(number, name, _without_gaps(intervals, end_s), end_s)
    with whole_file(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _without_gaps(intervals: list[Interval], duration_s: float) -> list[Interval]:
    """Return intervals from 0 s to the end that follow each other; what was a gap has no text. Praat requires that."""
    whole: list[Interval] = []
    end_s = 0.0
    for start_s, stop_s, text in intervals:
        if start_s > end_s:
            whole.append((end_s, start_s, ""))
        whole.append((end_s if start_s < end_s else start_s, stop_s, text))
        end_s = stop_s
    return [*whole, (end_s, duration_s, "")] if end_s < duration_s else whole


def _tier(number: int, name: str, intervals: list[Interval], end_s: float) -> list[str]:
    """Return the lines of one tier."""
    lines = [f"    item [{number}]:", '        class = "IntervalTier"', f'        name = "{name}"']
    lines += ["        xmin = 0", f"        xmax = {end_s}", f"        intervals: size = {len(intervals)}"]
    for place, (start_s, stop_s, text) in enumerate(intervals, 1):
        quoted = text.replace('"', '""')
        lines += [
            f"        intervals [{place}]:",
            f"            xmin = {start_s}",
            f"            xmax = {stop_s}",
        ]
        lines.append(f'            text = "{quoted}"')
    return lines
