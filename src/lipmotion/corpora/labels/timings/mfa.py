"""Alignments of the Montreal Forced Aligner as JSON and CSV; its TextGrids are read as all TextGrids are.

Phones are those of the acoustic model's dictionary: ARPAbet, or IPA.

Source: Montreal Forced Aligner 3, ``--output_format``; praatIO, ``Textgrid.save(format="json")``.
"""

from __future__ import annotations

import csv
from io import StringIO

from lipmotion.corpora.labels.tier import (
    LabelTier,
    TimedLabel,
    check_count,
    is_named_as_phones,
    is_named_as_words,
    is_silence,
    required_time,
)
from lipmotion.corpora.labels.timings.ipa import in_inventory
from lipmotion.corpora.labels.timings.rows import Documents, required_seconds, required_text, tiers_of
from lipmotion.errors import InputError

HEADER = ("begin", "end", "label", "type")


def tiers(documents: Documents, where: str) -> list[LabelTier] | None:
    """Return words and phones in time of the JSON; None: it is not MFA's.

    Of several speakers' tiers, those of each kind are taken together. Raises InputError: a time that is none, or a
    phone that is neither ARPAbet nor IPA.
    """
    value = documents[0][1] if len(documents) == 1 else None
    named = value.get("tiers") if isinstance(value, dict) else None
    if not isinstance(named, dict) or not all(
        isinstance(tier, dict) and isinstance(tier.get("entries"), list) for tier in named.values()
    ):
        return None
    found = [LabelTier(f"tier {name!r}", tuple(_entries(name, tier["entries"], where))) for name, tier in named.items()]
    words = [label for tier in found if is_named_as_words(tier) for label in tier.labels]
    phones = [label for tier in found if is_named_as_phones(tier) for label in tier.labels]
    return _of_both(words, phones, where)


def _entries(name: str, entries: list[object], where: str) -> list[TimedLabel]:
    check_count(len(entries), where)
    labels = []
    for number, entry in enumerate(entries, 1):
        place = f"tier {name!r}, entry {number}"
        if not isinstance(entry, list) or len(entry) != 3:
            raise InputError(f"{where}: {place} is no list of start, end and label")
        start_s, end_s = (required_seconds(time, where, place) for time in entry[:2])
        labels.append(TimedLabel(start_s, end_s, required_text(entry[2], where, place), place))
    return labels


def is_table(text: str) -> bool:
    """Return whether a text is MFA's CSV: its first line is ``Begin,End,Label,Type`` and perhaps more columns."""
    return text[:200].lstrip().lower().startswith(",".join(HEADER))


def table_tiers(text: str, where: str) -> list[LabelTier]:
    """Return words and phones in time of MFA's CSV. Raises InputError: a line of another form, with its number."""
    rows: dict[str, list[TimedLabel]] = {"words": [], "phones": []}
    for number, line in enumerate(StringIO(text.lstrip()), 1):
        if number == 1 or not line.strip():
            continue
        check_count(number, where)
        place = f"line {number}"
        try:
            fields = next(csv.reader([line]))
            start_s, end_s = (required_time(time, place, where) for time in fields[:2])
            label, kind = fields[2:4]
        except InputError:
            raise
        except (ValueError, csv.Error) as error:
            raise InputError(f"{where}: {place} is not: begin, end, label, type ({error})") from error
        if kind in rows:
            rows[kind].append(TimedLabel(start_s, end_s, label, place))
    return _of_both(rows["words"], rows["phones"], where)


def _of_both(words: list[TimedLabel], phones: list[TimedLabel], where: str) -> list[LabelTier]:
    """Return the tiers of words, without silence, and of phones, in order of time."""
    spoken = [label for label in words if not is_silence(label.text)]
    ordered = sorted(phones, key=lambda label: label.start_s)
    return tiers_of(where, sorted(spoken, key=lambda label: label.start_s), in_inventory(ordered, where))
