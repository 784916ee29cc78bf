"""Phones in IPA with their times, as the phones of the inventory that look like them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

from lipmotion.corpora.labels.tier import PHONES_SHARE, SILENCES, TimedLabel, is_silence, phone_of
from lipmotion.errors import InputError, shortened
from lipmotion.units import PHONES, SILENCE
from lipmotion.units.ipa_phones import ipa_phones, token_phones

PAUSES = frozenset((" ", *SILENCES, *' ^ $ . , ; : ! ? — – … ( ) “ ” " « » ¡ ¿'.split(" ")))
"""Symbols of voices for silence: padding, blanks and punctuation, which last as long as the pause."""
LONGEST_SYMBOL = 40
"""Most letters of a phone with all its marks."""
WITH_GLIDES = {"aj": "aɪ", "ej": "eɪ", "ɔj": "ɔɪ", "ow": "oʊ", "əw": "əʊ", "aw": "aʊ"}
"""Diphthongs as the Montreal Forced Aligner writes them."""
NO_SOUND = "<sil>"
"""What stands for silence among tokens: no sound goes on beyond it."""


def inventory_labels(labels: Sequence[TimedLabel], where: str) -> list[TimedLabel]:
    """Return phones in IPA as phones of the inventory, in the same time.

    Symbols that are one sound together are one phone, as ``a`` and ``ɪ``; a symbol of several sounds is divided into
    equal times; marks, as those of stress and length, are part of the phone before. Source: ``units.ipa_phones``.
    Raises InputError: a symbol that is none of IPA, with its place.
    """
    for label in labels:
        if len(label.text) > LONGEST_SYMBOL:
            length = len(label.text)
            raise InputError(
                f"{where}: {label.position} has {length} letters, required a phone: {LONGEST_SYMBOL} at most"
            )
        unknown = "" if label.text in PAUSES else ipa_phones(label.text)[1]
        if unknown:
            raise InputError(
                f"{where}: {label.position} is {shortened(label.text)!r}, which is no phone (not IPA: {unknown!r}); "
                f"required IPA, or: {' '.join(PHONES)}"
            )
    begun: dict[int, list[str]] = defaultdict(list)
    for phone, number in token_phones([NO_SOUND if label.text in PAUSES else label.text for label in labels]):
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
        elif label.text not in PAUSES and found and found[-1].end_s >= label.start_s:
            found[-1] = replace(found[-1], end_s=label.end_s)
        else:
            found.append(replace(label, text=SILENCE))
    return found


def in_inventory(labels: Sequence[TimedLabel], where: str) -> list[TimedLabel]:
    """Return phones in time as they are, if most are the inventory's or ARPAbet's, else read as IPA.

    Raises InputError: as ``inventory_labels``.
    """
    spoken = [label for label in labels if not is_silence(label.text)]
    if sum(phone_of(label.text) is not None for label in spoken) >= PHONES_SHARE * len(spoken):
        return list(labels)
    return inventory_labels([replace(label, text=WITH_GLIDES.get(label.text, label.text)) for label in labels], where)
