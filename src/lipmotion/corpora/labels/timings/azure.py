"""Events of Azure's speech synthesis: word boundaries and visemes, one object an event, in a list or one a line.

Names are those of the events' fields in any of the SDK's languages (``audioOffset``, ``audio_offset``,
``privAudioOffset``). Offsets and durations are in ticks of 100 ns, those of batch synthesis (``NNNN.word.json``) in
milliseconds.

Source: Microsoft Learn, "Get facial position with viseme", "How to synthesize speech", "Batch synthesis properties".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lipmotion.corpora.labels.tier import LabelTier, TimedLabel
from lipmotion.corpora.labels.timings.rows import Documents, required_seconds, required_text, tiers_of, until_next
from lipmotion.errors import InputError, shortened

TICKS_PER_S, MS_PER_S = 10_000_000, 1000
SHORTEST_S = 0.001
"""If the longest duration, taken for ticks, is shorter, it is in milliseconds: as such no word lasts ten seconds."""
PHONE_OF = "sil ah aa ao eh er ih uw ow aw oy ay hh r l s sh th f t k p".split()
"""A phone with the mouth of each of the 22 visemes, by its number."""
SPOKEN = frozenset(("", "word", "wordboundary"))
"""Kinds of boundaries that are words; others are of punctuation and sentences."""
OFFSET, VISEME, TEXT, DURATION, KIND = "audiooffset", "visemeid", "text", "duration", "boundarytype"


def tiers(documents: Documents, where: str) -> list[LabelTier] | None:
    """Return words and visemes in time; None: these are no events of Azure.

    A viseme lasts to the next one. Raises InputError: a viseme of another number, or a time that is none.
    """
    values = [value for _, value in documents]
    items = values[0] if len(values) == 1 and isinstance(values[0], list) else values
    events = [_event(item) for item in items if isinstance(item, dict)]
    if (
        not items
        or len(events) < len(items)
        or not all(OFFSET in each and {VISEME, TEXT} & each.keys() for each in events)
    ):
        return None
    numbered = [(f"event {number}", event) for number, event in enumerate(events, 1)]
    words = [(place, event) for place, event in numbered if VISEME not in event and _kind(event) in SPOKEN]
    visemes = [_viseme(event, place, where) for place, event in numbered if VISEME in event]
    per_s = _per_s(words, where)
    return tiers_of(where, [_word(event, place, where, per_s) for place, event in words], until_next(visemes))


def _event(item: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of an event by their names without capitals, underscores and JavaScript's ``priv``."""
    return {name.replace("_", "").lower().removeprefix("priv"): value for name, value in item.items()}


def _kind(event: Mapping[str, Any]) -> str:
    return str(event.get(KIND, "")).rpartition(".")[2].lower()


def _per_s(words: Sequence[tuple[str, Mapping[str, Any]]], where: str) -> int:
    """Return how many units of the times of words make a second."""
    durations_s = (required_seconds(event.get(DURATION), where, place, TICKS_PER_S) for place, event in words)
    return TICKS_PER_S if max(durations_s, default=0.0) >= SHORTEST_S else MS_PER_S


def _word(event: Mapping[str, Any], place: str, where: str, per_s: int) -> TimedLabel:
    start_s = required_seconds(event[OFFSET], where, place, per_s)
    duration_s = required_seconds(event.get(DURATION), where, place, per_s)
    return TimedLabel(start_s, start_s + duration_s, required_text(event[TEXT], where, place), place)


def _viseme(event: Mapping[str, Any], place: str, where: str) -> TimedLabel:
    start_s, number = required_seconds(event[OFFSET], where, place, TICKS_PER_S), event[VISEME]
    if not isinstance(number, int) or not 0 <= number < len(PHONE_OF):
        found = shortened(repr(number)[:200])
        raise InputError(f"{where}: {place}: the viseme is {found}, required 0 to {len(PHONE_OF) - 1}")
    return TimedLabel(start_s, start_s, PHONE_OF[number], place)
