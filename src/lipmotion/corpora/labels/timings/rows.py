"""Rows of words or phones in time, from the JSON of a service, as tiers of labels."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import zip_longest
from typing import Any

from lipmotion.corpora.labels.json_documents import json_seconds
from lipmotion.corpora.labels.tier import ROUNDING_S, LabelTier, TimedLabel, check_count, is_silence
from lipmotion.errors import InputError, shortened
from lipmotion.units import PAUSE, SILENCE
from lipmotion.units.phones import SHORT_PAUSE_S

WORDS, PHONES = "tier 'words'", "tier 'phones'"
"""Names of tiers, by which ``tier.is_named_as_words`` and ``is_named_as_phones`` know them."""
Documents = Sequence[tuple[int, Any]]
"""The values of a file, each with the number of its first line."""


def tiers_of(where: str, words: Sequence[TimedLabel] = (), phones: Sequence[TimedLabel] = ()) -> list[LabelTier]:
    """Return the tiers of words and of phones, each if there are any. Raises InputError: too many, or none at all."""
    tiers = [LabelTier(name, tuple(rows)) for name, rows in ((PHONES, _filled(phones)), (WORDS, words)) if rows]
    if not tiers:
        raise InputError(f"{where}: holds no word and no phone in time; ask the service for them")
    for tier in tiers:
        check_count(len(tier.labels), where)
    return tiers


def _filled(phones: Sequence[TimedLabel]) -> list[TimedLabel]:
    """Return phones with silence in the gaps between them; where it is short, a pause."""
    filled: list[TimedLabel] = []
    for label in phones:
        gap_s = label.start_s - filled[-1].end_s if filled else 0.0
        if gap_s > ROUNDING_S:
            filled.append(replace(label, start_s=filled[-1].end_s, end_s=label.start_s, text=SILENCE))
        filled.append(label)
    return [
        replace(label, text=PAUSE)
        if is_silence(label.text) and 0 < number < len(filled) - 1 and label.end_s - label.start_s < SHORT_PAUSE_S
        else label
        for number, label in enumerate(filled)
    ]


def parallel_lists(owner: Any, names: Sequence[str], where: str) -> list[tuple[Any, ...]]:
    """Return the items of parallel lists of an object, item by item.

    Raises InputError: one of the lists is missing, or they are of several lengths.
    """
    columns = [owner.get(name) if isinstance(owner, dict) else None for name in names]
    lists = [column for column in columns if isinstance(column, list)]
    if len(lists) < len(names) or len({len(column) for column in lists}) > 1:
        raise InputError(f"{where}: required are the lists {', '.join(names)}, all of one length")
    check_count(len(lists[0]), where)
    return list(zip(*lists, strict=True))


def required_seconds(value: Any, where: str, place: str, per_s: float = 1.0) -> float:
    """Return a time in seconds. Raises InputError: it is missing, or no number."""
    time_s = json_seconds(value, f"{where}: {place}", per_s)
    if time_s is None:
        raise InputError(f"{where}: {place} has no time")
    return time_s


def required_text(value: Any, where: str, place: str) -> str:
    """Return a text. Raises InputError: it is none."""
    if not isinstance(value, str):
        raise InputError(f"{where}: {place} is {shortened(repr(value)[:200])}, required a text")
    return value


def until_next(rows: Iterable[TimedLabel], silences_s: Sequence[float] = ()) -> list[TimedLabel]:
    """Return rows in order of time, each of which ends where the next one, or a silence, begins; the last is open.

    silences_s : starts of silences
    """
    ordered = sorted(rows, key=lambda row: row.start_s)
    silent = sorted(silences_s)
    ended, at = [], 0
    for row, following in zip_longest(ordered, ordered[1:]):
        while at < len(silent) and silent[at] <= row.start_s:
            at += 1
        end_s = math.inf if following is None else following.start_s
        ended.append(replace(row, end_s=min([end_s, *silent[at : at + 1]])))
    return ended
