"""Phones in IPA or X-SAMPA with their times, as the phones of the inventory that look like them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

from lipmotion.errors import InputError, shortened
from lipmotion.formats.label_tiers import (
    PHONE_LABELS,
    PHONES_SHARE,
    ROUNDING_S,
    LabelTier,
    TimedLabel,
    phone_of,
)
from lipmotion.units import PAUSE, PHONES, SILENCE, UNKNOWN_PHONES
from lipmotion.units.ipa_phones import ipa_phones, token_phones, xsampa_as_ipa
from lipmotion.units.phones import SHORT_PAUSE_S
from lipmotion.units.spoken_text import SpokenAs, spoken_as

PAUSES = frozenset((" ", *' ^ $ . , ; : ! ? — – … ( ) “ ” " « » ¡ ¿'.split(" ")))
"""Symbols of voices for silence: padding, blanks and punctuation, which last as long as the pause."""
LONGEST_SYMBOL = 40
"""Most letters of a phone with all its marks."""
WITH_GLIDES = {"aj": "aɪ", "ej": "eɪ", "ɔj": "ɔɪ", "ow": "oʊ", "əw": "əʊ", "aw": "aʊ"}
"""Diphthongs as the Montreal Forced Aligner writes them."""
NO_SOUND = "<sil>"
"""What stands for silence among tokens: no sound goes on beyond it."""


def ipa_labels(labels: Sequence[TimedLabel], where: str) -> list[TimedLabel]:
    """Return phones in IPA as phones of the inventory, in the same time.

    Symbols that are one sound together are one phone, as ``a`` and ``ɪ``; a symbol of several sounds is divided into
    equal times; marks, as those of stress and length, are part of the phone before. Source: ``units.ipa_phones``.
    Raises InputError: a symbol that is none of IPA, with its place.
    """
    unspoken = [label.text in PAUSES or spoken_as(label.text) is not SpokenAs.SPEECH for label in labels]
    for label, pause in zip(labels, unspoken, strict=True):
        if len(label.text) > LONGEST_SYMBOL:
            length = len(label.text)
            raise InputError(
                f"{where}: {label.position} has {length} letters, required a phone: {LONGEST_SYMBOL} at most"
            )
        unknown = "" if pause else ipa_phones(label.text)[1]
        if unknown:
            raise InputError(
                f"{where}: {label.position} is {shortened(label.text)!r}, which is no phone (not IPA: {unknown!r}); "
                f"required IPA, X-SAMPA, or: {' '.join(PHONES)}"
            )
    begun: dict[int, list[str]] = defaultdict(list)
    tokens = [NO_SOUND if pause else label.text for label, pause in zip(labels, unspoken, strict=True)]
    for phone, number in token_phones(tokens):
        begun[number].append(phone)
    found: list[TimedLabel] = []
    for number, label in enumerate(labels):
        phones = begun.get(number, [])
        if phones:
            each_s = (label.end_s - label.start_s) / len(phones)
            edges_s = [label.start_s + place * each_s for place in range(len(phones))] + [label.end_s]
            found += [
                replace(label, start_s=start_s, end_s=end_s, text=phone)
                for phone, start_s, end_s in zip(phones, edges_s[:-1], edges_s[1:], strict=True)
            ]
        elif not unspoken[number] and found and found[-1].end_s >= label.start_s:
            found[-1] = replace(found[-1], end_s=label.end_s)
        else:
            is_speech = spoken_as(label.text) is SpokenAs.UNKNOWN
            found.append(replace(label, text=UNKNOWN_PHONES if is_speech else SILENCE))
    return found


def inventory_labels(labels: Sequence[TimedLabel], where: str) -> tuple[TimedLabel, ...]:
    """Return phones in time in the notation in which they make sense: as they are, X-SAMPA, or IPA.

    Raises InputError: as ``ipa_labels``.
    """
    spoken = [WITH_GLIDES.get(label.text, label.text) for label in labels if spoken_as(label.text) is SpokenAs.SPEECH]
    in_inventory = sum(phone_of(text) is not None for text in spoken)
    in_xsampa = sum(bool(xsampa_as_ipa(text)) for text in spoken)
    if in_inventory == len(spoken) or (in_inventory >= PHONES_SHARE * len(spoken) and in_xsampa < len(spoken)):
        return tuple(labels)
    as_ipa = WITH_GLIDES
    if all(map(str.isascii, spoken)) and in_xsampa >= PHONES_SHARE * len(spoken):
        as_ipa = {text: xsampa_as_ipa(text) or text for text in spoken}
    return tuple(ipa_labels([replace(label, text=as_ipa.get(label.text, label.text)) for label in labels], where))


def in_inventory(tier: LabelTier, where: str) -> LabelTier:
    """Return a tier; one of phones in the phones of the inventory. Raises InputError: as ``ipa_labels``."""
    is_phones = tier.role == PHONE_LABELS
    return replace(tier, labels=inventory_labels(tier.labels, where)) if is_phones else tier


def with_pauses(phones: Sequence[TimedLabel]) -> tuple[TimedLabel, ...]:
    """Return phones with silence in the gaps between them; where it is short, a pause."""
    filled: list[TimedLabel] = []
    for label in phones:
        gap_s = label.start_s - filled[-1].end_s if filled else 0.0
        if gap_s > ROUNDING_S:
            filled.append(replace(label, start_s=filled[-1].end_s, end_s=label.start_s, text=SILENCE))
        filled.append(label)
    return tuple(
        replace(label, text=PAUSE)
        if spoken_as(label.text) is SpokenAs.SILENCE
        and 0 < number < len(filled) - 1
        and label.end_s - label.start_s < SHORT_PAUSE_S
        else label
        for number, label in enumerate(filled)
    )
