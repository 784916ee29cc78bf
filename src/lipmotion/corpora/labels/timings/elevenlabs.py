"""Alignments of ElevenLabs: every character with its start and end, of which words are made.

Read are the answers of "text to speech with timestamps" (whole, or one object a piece) and those of its web socket.

Source: ElevenLabs API reference, "Create speech with timing", "Stream speech with timing", "WebSocket".
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import accumulate
from typing import Any

from lipmotion.corpora.labels.tier import LabelTier, TimedLabel
from lipmotion.corpora.labels.timings.rows import (
    Documents,
    parallel_lists,
    required_seconds,
    required_text,
    tiers_of,
)
from lipmotion.errors import InputError

Character = tuple[str, float, float]
ALIGNMENTS = ("normalized_alignment", "normalizedAlignment", "alignment")
"""What is said (numbers as words) comes before what was written."""
CHARACTERS = ("characters", "character_start_times_seconds", "character_end_times_seconds")
OF_SOCKET = ("chars", "charStartTimesMs", "charDurationsMs")
FORMER_DURATIONS = "charsDurationsMs"
MS_PER_S = 1000
WORD = re.compile(r"\[[^\[\]]*\]|[^\s\[]+")
"""A word, or a direction in brackets (``[whispers]``), which is not said."""


def tiers(documents: Documents, where: str) -> list[LabelTier] | None:
    """Return words in time; None: these are no alignments of ElevenLabs.

    Raises InputError: lists that do not fit, a time that is none, or several pieces of the web socket, whose times
    begin anew.
    """
    found = [(line, _alignment(value)) for line, value in documents]
    if not any(alignment for _, alignment in found):
        return None
    given = [(f"line {line}", alignment) for line, alignment in found if alignment]
    if len(given) > 1 and any(OF_SOCKET[0] in alignment for _, alignment in given):
        raise InputError(
            f"{where}: holds {len(given)} pieces whose times each begin at 0; save the sound of each apart"
        )
    characters = [each for place, alignment in given for each in _characters(alignment, place, where)]
    ends = list(accumulate(len(text) for text, _, _ in characters))
    owner = [number for number, (text, _, _) in enumerate(characters) for _ in text]
    words = []
    for match in WORD.finditer("".join(text for text, _, _ in characters)):
        if match[0].startswith("["):
            continue
        first, last = owner[match.start()], owner[match.end() - 1]
        words.append(TimedLabel(characters[first][1], characters[last][2], match[0], f"character {ends[first]}"))
    return tiers_of(where, words)


def _alignment(value: Any) -> Mapping[str, Any]:
    """Return the alignment of an answer; empty: it has none."""
    owners = [value.get(name) for name in ALIGNMENTS] + [value] if isinstance(value, dict) else []
    known = {CHARACTERS[1], OF_SOCKET[1]}
    return next((owner for owner in owners if isinstance(owner, dict) and known & owner.keys()), {})


def _characters(alignment: Mapping[str, Any], place: str, where: str) -> list[Character]:
    """Return the characters with their start and end, s."""
    if OF_SOCKET[0] not in alignment:
        rows = parallel_lists(alignment, CHARACTERS, f"{where}: {place}")
        return [
            (
                required_text(text, where, place),
                required_seconds(start, where, place),
                required_seconds(end, where, place),
            )
            for text, start, end in rows
        ]
    renamed = {OF_SOCKET[2]: alignment.get(FORMER_DURATIONS), **alignment}
    found = []
    for text, start, duration in parallel_lists(renamed, OF_SOCKET, f"{where}: {place}"):
        start_s, duration_s = (required_seconds(time, where, place, MS_PER_S) for time in (start, duration))
        found.append((required_text(text, where, place), start_s, start_s + duration_s))
    return found
