"""Alignments of Piper: every phoneme with its number of samples, and the sampling rate, one object for each sentence.

The names are those of Piper's Python interface: ``sample_rate`` and ``phoneme_alignments`` of an ``AudioChunk``,
``phoneme`` and ``num_samples`` of each alignment. Sentences follow one another.

Source: Piper 1.4, docs/ALIGNMENTS.md.
"""

from __future__ import annotations

from typing import Any

from lipmotion.corpora.labels.tier import LabelTier, TimedLabel, check_count
from lipmotion.corpora.labels.timings.ipa import inventory_labels
from lipmotion.corpora.labels.timings.rows import Documents, required_seconds, required_text, tiers_of
from lipmotion.errors import InputError, shortened

ALIGNMENTS, RATE, PHONEME, SAMPLES = "phoneme_alignments", "sample_rate", "phoneme", "num_samples"


def tiers(documents: Documents, where: str) -> list[LabelTier] | None:
    """Return phones in time; None: these are no alignments of Piper.

    Raises InputError: no sampling rate, a number of samples that is none, or a phoneme that is no IPA.
    """
    chunks = [chunk for _, value in documents for chunk in (value if isinstance(value, list) else [value])]
    if not chunks or not all(isinstance(chunk, dict) and isinstance(chunk.get(ALIGNMENTS), list) for chunk in chunks):
        return None
    labels: list[TimedLabel] = []
    now_s = 0.0
    for sentence, chunk in enumerate(chunks, 1):
        rate_hz = _rate(chunk.get(RATE), f"{where}: sentence {sentence}")
        check_count(len(labels) + len(chunk[ALIGNMENTS]), where)
        for number, item in enumerate(chunk[ALIGNMENTS], 1):
            place = f"sentence {sentence}, phoneme {number}"
            fields = item if isinstance(item, dict) else {}
            duration_s = required_seconds(fields.get(SAMPLES), where, place, rate_hz)
            text = required_text(fields.get(PHONEME), where, place)
            labels.append(TimedLabel(now_s, now_s + duration_s, text, place))
            now_s += duration_s
    return tiers_of(where, phones=inventory_labels(labels, where))


def _rate(value: Any, where: str) -> float:
    """Return a sampling rate. Raises InputError: it is none."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not 1000 <= value <= 1_000_000:
        found = shortened(repr(value)[:200])
        raise InputError(f"{where}: the member {RATE!r} is {found}, required the sampling rate of the sound in hertz")
    return float(value)
