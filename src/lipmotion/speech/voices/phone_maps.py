"""Maps from the phones of the synthesisers to those of the inventory of 47.

A label that maps to several phones is divided into equal times; a label that maps to none is part of the phone before
it. Unstressed AH, ER and IH become ax, axr and ix where the dictionary says so (``inventory_phones``).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from lipmotion.units import PHONES, SILENCE
from lipmotion.units.ipa_phones import read_ipa

PhoneMap = Mapping[str, tuple[str, ...]]
"""A synthesiser's label to phones of the inventory."""

ARPABET_PHONES: PhoneMap = {phone: (phone,) for phone in PHONES} | {"pau": (SILENCE,)}
"""Flite and Festival (phone set ``radio``). They have their own ax; their er and ih are stressed and unstressed."""

_ESPEAK: dict[str, str] = {
    # silences
    "_ _: _| _^_ |": SILENCE,
    # vowels, by their sounds in American English
    "0 A: A": "aa",
    "a aa": "ae",
    "V": "ah",
    "O O: O2": "ao",
    "aU": "aw",
    "@ @2 @5 a#": "ax",
    "3": "axr",
    "aI": "ay",
    "E": "eh",
    "3:": "er",
    "eI": "ey",
    "I": "ih",
    "I# I2": "ix",
    "i i:": "iy",
    "oU": "ow",
    "OI": "oy",
    "U": "uh",
    "u u:": "uw",
    # vowels with the r that follows, or with another vowel
    "A@": "aa r",
    "O@ o@": "ao r",
    "e@": "eh r",
    "U@": "uh r",
    "i@3": "ih r",
    "i@": "iy ax",
    "aI@": "ay ax",
    "aI3": "ay axr",
    "aU@": "aw axr",
    "@L": "el",
    "n-": "en",
    "m-": "em",
    # consonants; ? is a t that stays in the throat, t# one that the tongue only touches
    "b": "b", "d d#": "d", "D": "dh", "dZ": "jh", "f": "f", "g": "g", "h": "hh", "j": "y", "k": "k", "l": "l", "m": "m",
    "n": "n", "N": "ng", "p": "p", "r r-": "r", "s": "s", "S": "sh", "t t# t2 ?": "t", "tS": "ch", "T": "th", "v": "v",
    "w": "w", "z": "z", "Z": "zh",
    # parts of what is before: the glide from a vowel to the next, the beginning of an unstressed vowel
    "; @-": "",
}  # fmt: skip
ESPEAK_PHONES: PhoneMap = {
    label: tuple(phones.split()) for labels, phones in _ESPEAK.items() for label in labels.split()
}
"""espeak-ng's mnemonics (as ``espeak-ng -x`` writes them), voice en-us."""


def complete_map(labels: Iterable[str], table: PhoneMap, *, ipa: bool) -> tuple[PhoneMap, tuple[str, ...]]:
    """Return a map for all labels, and what of them no table has.

    table : labels with their phones, which count first
    ipa   : whether the other labels are IPA; else those that are not in the table are read as if they were, and are
            reported. A label that begins with ``_`` is a silence.
    """
    found: dict[str, tuple[str, ...]] = {}
    unknown: dict[str, None] = {}
    for label in labels:
        if label in table:
            found[label] = table[label]
        elif label.startswith("_"):
            found[label] = (SILENCE,)
        elif label not in found:
            found[label], letters = read_ipa(label)
            unknown |= dict.fromkeys(letters if ipa else [label])
    return found, tuple(unknown)
