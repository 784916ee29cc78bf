"""What Kokoro says of a sentence: phonemes with their durations, or words with their times.

The names are those of its Python interface: ``phonemes`` and ``pred_dur`` of a result, ``text``, ``start_ts`` and
``end_ts`` of its ``tokens``; and of servers that speak with it, ``word``, ``start_time`` and ``end_time``.

Source: Kokoro 0.9, pipeline.py (``Result``, ``join_timestamps``); Misaki, EN_PHONES.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lipmotion.corpora.labels.tier import LabelTier, TimedLabel, check_count
from lipmotion.corpora.labels.timings.ipa import inventory_labels
from lipmotion.corpora.labels.timings.rows import Documents, required_seconds, required_text, tiers_of
from lipmotion.errors import InputError

FRAMES_PER_S = 40
"""Durations are in frames of 600 samples at 24 kHz."""
SPELT = {"A": "eɪ", "I": "aɪ", "W": "aʊ", "Y": "ɔɪ", "O": "oʊ", "Q": "əʊ", "ᵊ": "ə", "T": "ɾ"}
"""Kokoro's own letters, in IPA."""
PHONEMES, DURATIONS, TOKENS = "phonemes", "pred_dur", "tokens"
OF_TOKENS, OF_SERVERS = ("text", "start_ts", "end_ts"), ("word", "start_time", "end_time")


def tiers(documents: Documents, where: str) -> list[LabelTier] | None:
    """Return words and phones in time; None: this is no result of Kokoro.

    Words have the times of the tokens; punctuation, and tokens without times, are passed over.
    Raises InputError: durations that do not fit, several sentences with durations, or a phoneme that is no IPA.
    """
    owners = [value for _, value in documents if isinstance(value, dict)]
    items = [item for _, value in documents for item in _items(value)]
    timed = [owner for owner in owners if PHONEMES in owner and isinstance(owner.get(DURATIONS), list)]
    if len(owners) + sum(isinstance(value, list) for _, value in documents) < len(documents) or not (timed or items):
        return None
    if len(timed) > 1:
        raise InputError(f"{where}: holds {len(timed)} sentences, whose times each begin at 0; give those of one")
    words = [word for number, item in enumerate(items, 1) if (word := _word(item, f"token {number}", where))]
    return tiers_of(where, words, _phones(timed[0], where) if timed else ())


def _items(value: Any) -> list[Mapping[str, Any]]:
    """Return the tokens of a value with the names of Kokoro's times; none of another kind."""
    listed = value
    if isinstance(value, dict):
        listed = value.get(TOKENS, value.get("timestamps"))
    if not isinstance(listed, list) or not all(isinstance(item, dict) for item in listed):
        return []
    return [item for item in listed if any({*names} <= item.keys() for names in (OF_TOKENS, OF_SERVERS))]


def _word(item: Mapping[str, Any], place: str, where: str) -> TimedLabel | None:
    """Return the word of a token; None: it is punctuation, or has no time."""
    text, *times = (item[name] for name in (OF_TOKENS if OF_TOKENS[1] in item else OF_SERVERS))
    if None in times or not any(map(str.isalnum, required_text(text, where, place))):
        return None
    start_s, end_s = (required_seconds(time, where, place) for time in times)
    return TimedLabel(start_s, end_s, text, place)


def _phones(owner: Mapping[str, Any], where: str) -> list[TimedLabel]:
    """Return the phones of a result: its durations are those of a beginning, of the phonemes, and of an end."""
    phonemes, durations = required_text(owner[PHONEMES], where, PHONEMES), owner[DURATIONS]
    if len(durations) != len(phonemes) + 2:
        raise InputError(
            f"{where}: {len(durations)} durations of {len(phonemes)} phonemes, required two more than phonemes"
        )
    check_count(len(durations), where)
    labels, now_s = [], 0.0
    for number, (letter, frames) in enumerate(zip(f"^{phonemes}$", durations, strict=True)):
        place = f"phoneme {number}"
        duration_s = required_seconds(frames, where, place, FRAMES_PER_S)
        labels.append(TimedLabel(now_s, now_s + duration_s, SPELT.get(letter, letter), place))
        now_s += duration_s
    return inventory_labels(labels, where)
