"""Cues of subtitles: lines of text that are shown together, with their times."""

from __future__ import annotations

import re
from dataclasses import dataclass

from lipmotion.errors import InputError

CLOCK = r"(?:(\d{1,4}):)?(\d{1,2}):(\d{1,2})(?:[.,](\d{1,6}))?"
"""A time as subtitles write it: hours (which may be missing), minutes, seconds, and their fraction."""


@dataclass(frozen=True)
class SubtitleCue:
    """Some lines of text that are shown together.

    number : of the line of the file that holds its times
    """

    number: int
    start_s: float
    end_s: float
    lines: tuple[str, ...]


def clock_seconds(match: re.Match[str], group: int) -> float:
    """Return the time in seconds of the four groups of ``CLOCK`` in a match; ``group``: the first of them."""
    hours, minutes, seconds, fraction = match.group(group, group + 1, group + 2, group + 3)
    return int(hours or 0) * 3600 + int(minutes) * 60 + float(f"{seconds}.{fraction or 0}")


def checked_cue(cue: SubtitleCue, where: str) -> SubtitleCue:
    """Return a cue. Raises InputError: it ends before it starts; ``where``: the file's name, for the message."""
    if cue.end_s < cue.start_s:
        raise InputError(
            f"{where}: line {cue.number} ends at {cue.end_s:g} s, before its start at {cue.start_s:g} s; correct it"
        )
    return cue
