"""Words or phones in time as subtitles show them, one a cue."""

from __future__ import annotations

from pathlib import Path

from lipmotion.types import Timeline, Unit
from lipmotion.units import is_silent, words_in_time

PHONES = ".phones"
"""A file whose name ends so before its suffix, as ``talk.phones.vtt``, holds phones, not words."""


def shown_labels(path: Path, units: Timeline[Unit]) -> list[tuple[float, float, str]]:
    """Return start, end and text of each word, or of each phone where the name of the file asks for them; no silence.

    Words are those of ``units.words_in_time``.
    """
    if path.stem.lower().endswith(PHONES):
        spoken = [span for span in units if not is_silent(span.label.phone)]
        return [(span.start_s, span.end_s, span.label.phone or span.label.unit) for span in spoken]
    return [(span.start_s, span.end_s, span.label) for span in words_in_time(units) if span.label]


def clock(seconds: float, mark: str) -> str:
    """Return a time as ``HH:MM:SS.mmm``; ``mark``: what stands before the thousandths."""
    thousandths = round(seconds * 1000)
    minutes, rest = divmod(thousandths, 60_000)
    return f"{minutes // 60:02d}:{minutes % 60:02d}:{rest // 1000:02d}{mark}{rest % 1000:03d}"
