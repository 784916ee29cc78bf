"""Alignments of Gentle: words with their times, and phones with their durations.

Source: lowerquality/gentle, README.md and transcription.py.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

from lipmotion.corpora.labels.tier import LabelTier, TimedLabel
from lipmotion.corpora.labels.timings.rows import Documents, required_seconds, required_text, tiers_of

LOG = logging.getLogger("lipmotion")
FOUND = "success"
UNKNOWN = "oov"
"""Gentle's phone of words that are in no dictionary."""


def tiers(documents: Documents, where: str) -> list[LabelTier] | None:
    """Return words and phones in time; None: this is no alignment of Gentle.

    Words that were not found in the sound are passed over, with a warning. Raises InputError: a time that is none.
    """
    value = documents[0][1] if len(documents) == 1 else None
    words = value.get("words") if isinstance(value, dict) else None
    if not isinstance(words, list) or not words or not all(isinstance(word, dict) and "case" in word for word in words):
        return None
    labels, phones, missed = [], [], 0
    for number, word in enumerate(words, 1):
        if word["case"] != FOUND:
            missed += 1
            continue
        place = f"word {number}"
        start_s, end_s = (required_seconds(word.get(name), where, place) for name in ("start", "end"))
        labels.append(TimedLabel(start_s, end_s, required_text(word.get("word"), where, place), place))
        phones += _phones(word, start_s, place, where)
    if missed:
        LOG.warning("%s: %d of %d words were not found in the sound and are left out", where, missed, len(words))
    return tiers_of(where, labels, phones)


def _phones(word: Mapping[str, Any], start_s: float, place: str, where: str) -> list[TimedLabel]:
    """Return the phones of a word: ``hh_B`` is hh, at the beginning of it."""
    phones = []
    items = word.get("phones")
    for number, item in enumerate(items if isinstance(items, list) else [], 1):
        fields = item if isinstance(item, dict) else {}
        name = required_text(fields.get("phone"), where, f"{place}, phone {number}").partition("_")[0]
        end_s = start_s + required_seconds(fields.get("duration"), where, f"{place}, phone {number}")
        phones.append(TimedLabel(start_s, end_s, "ax" if name == UNKNOWN else name, f"{place}, phone {number}"))
        start_s = end_s
    return phones
