"""Phones of other languages, in the International Phonetic Alphabet, to the phones of the nearest mouth shape.

What the lips do decides: French y (*rue*) is spoken with rounded lips and so becomes uw, although its tongue is that of
iy. Marks of length, tone, stress and of the way of speaking are not needed for that, and are left out.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from functools import cache

from lipmotion.speech.voices.phone_maps import PhoneMap
from lipmotion.units import SILENCE

_IPA: dict[str, str] = {
    # vowels; y ø œ are rounded, ɯ ɤ ɨ are not
    "aɪ ai aɪ̯": "ay", "aʊ au ɑu": "aw", "ɔɪ ɔʏ ɔy oɪ oi": "oy", "eɪ ei ɛɪ": "ey", "oʊ əʊ ou": "ow",
    "i": "iy", "ɪ": "ih", "e ɛ ε": "eh", "eː": "ey", "æ": "ae", "a ɑ ɶ A": "aa", "ɐ ʌ": "ah", "ɒ ɔ": "ao", "o": "ow",
    "ʊ ʏ œ ɵ": "uh", "u y ø ʉ": "uw", "ə ɤ ɘ": "ax", "ɚ": "axr", "ɜ ɝ ɞ": "er", "ɯ ɨ ᵻ": "ix",
    # lips, and lips and teeth; β and ɸ do not close the lips
    "p": "p", "b ɓ": "b", "m": "m", "f ɸ Φ pɸ": "f", "v ʋ β ɱ ⱱ": "v", "w ʍ ɥ": "w",
    # tongue and teeth, tongue and palate
    "t ʈ": "t", "d ɖ ɗ": "d", "n ɲ ɳ": "n", "θ": "th", "ð": "dh", "s": "s", "z": "z", "l ɫ ɭ ʎ ɬ ɮ ɺ ʟ": "l",
    "ʃ ɕ ʂ S": "sh", "ʒ ʑ ʐ": "zh", "tʃ tɕ tʂ ʧ": "ch", "dʒ dʑ dʐ ʤ": "jh", "ʦ": "t s", "ʣ": "d z",
    "r ɹ ɾ ɽ ɻ": "r", "j ç ʝ": "y",
    # tongue and soft palate, throat
    "k c q x χ ɧ": "k", "g ɡ ɟ ɢ ɠ ɣ ɰ ʛ ʄ": "g", "ŋ ɴ": "ng", "h ɦ ħ ʕ ʁ ʀ ʜ ʢ": "hh",
    # consonants that are a syllable, a stop of the throat
    "l̩": "el", "m̩": "em", "n̩": "en", "ʔ ʡ": "",
}  # fmt: skip
IPA_PHONES: dict[str, tuple[str, ...]] = {
    unicodedata.normalize("NFD", symbol): tuple(phones.split())
    for symbols, phones in _IPA.items()
    for symbol in symbols.split()
}
"""IPA symbols to phones of the inventory; the longest symbol counts."""
_LONGEST = max(map(len, IPA_PHONES))
_IGNORED = frozenset("'#\"ˈˌː.|‿^-_*!?;:,ˑʰʲʷˤˠʼ˞ʱⁿˡ0123456789()")
"""Marks that no mouth shape depends on; further ones are combining marks and tones."""
UNKNOWN = ("ax",)
"""What a letter becomes of which nothing is known: the mouth at ease, slightly open."""


@cache
def ipa_phones(label: str) -> tuple[tuple[str, ...], str]:
    """Return the phones of the inventory for a phone in IPA, and those of its letters that are in no table.

    A letter with marks that is in no table is the letter without them; any other becomes ax.

    >>> ipa_phones("ˈyː"), ipa_phones("pf"), ipa_phones("ɔ̃")
    ((('uw',), ''), (('p', 'f'), ''), (('ao',), ''))
    """
    if label.startswith("("):  # a change of language
        return (), ""
    text = unicodedata.normalize("NFD", label)
    phones: list[str] = []
    unknown, at = "", 0
    while at < len(text):
        symbol = next(
            (text[at : at + size] for size in range(_LONGEST, 0, -1) if text[at : at + size] in IPA_PHONES), ""
        )
        if symbol:
            phones += IPA_PHONES[symbol]
        elif not _is_mark(text[at]):
            phones += UNKNOWN
            unknown += text[at]
        at += len(symbol) or 1
    return tuple(phones), unknown


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
            found[label], letters = ipa_phones(label)
            unknown |= dict.fromkeys(letters if ipa else [label])
    return found, tuple(unknown)


def _is_mark(letter: str) -> bool:
    return letter in _IGNORED or unicodedata.category(letter) in ("Mn", "Sk", "Lm", "Cf", "Zs")
