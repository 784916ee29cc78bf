"""Phones of all languages, in the International Phonetic Alphabet, to the phones of the nearest mouth shape.

What is seen decides, in this order: for vowels rounding, then height (of the jaw), then backness, which nobody sees;
for consonants what the lips do, then the tip of the tongue, then manner. So French y (*rue*) becomes uw, which is
rounded and close as it is, although its tongue is that of iy; and the b of Spanish *lobo*, β, becomes v: lips that
nearly meet. Marks of length, tone, stress and of the way of speaking have no mouth shape of their own.

Source: International Phonetic Association, chart of 2020; J. C. Catford, "A Practical Introduction to Phonetics", 2001.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

from lipmotion.units.spelling import read_table

HEIGHTS = ("close", "near-close", "close-mid", "mid", "open-mid", "near-open", "open")


class Vowel(NamedTuple):
    """A vowel of the chart: its height (0: close, to 6: open), whether it is rounded, and its phone."""

    height: int
    rounded: bool
    phone: str


VOWEL_CHART: dict[str, Vowel] = {
    letter: Vowel(HEIGHTS.index(height), lips == "rounded", phone)
    for letter, row in read_table("vowels").items()
    for height, lips, phone in [row.split()]
}
IPA_PHONES: dict[str, tuple[str, ...]] = {letter: (vowel.phone,) for letter, vowel in VOWEL_CHART.items()} | {
    unicodedata.normalize("NFD", symbol): tuple(phones.split())
    for symbols, phones in read_table("ipa").items()
    for symbol in symbols.split()
}
"""IPA symbols to phones of the inventory; the longest symbol counts."""
_LONGEST = max(map(len, IPA_PHONES))
ROMAJI, PINYIN = read_table("romaji"), read_table("pinyin")
ONLY_ROMAJI = frozenset("cl ch sh ky gy ny hy by my py ry ty dy".split())
XSAMPA = read_table("xsampa") | {letter: letter for letter in "abcdefhijklmnopqrstuvwxyz"}
"""X-SAMPA's symbols, and so SAMPA's of WebMAUS, in IPA."""
_XSAMPA_SYMBOL = re.compile("|".join(map(re.escape, sorted(XSAMPA, key=len, reverse=True))) + r"|_[^\s\\]\\?|[`^-]")
_IGNORED = frozenset("'#\"ˈˌː.|‿^-_*!?;:,~%<>ˑʰʲˤˠʼʱⁿˡ0123456789()¹²³⁰⁴⁵⁻⁽⁾")
"""Marks that no mouth shape depends on; further ones are combining marks and tones."""
_TIES = str.maketrans("", "", "͜͡")
UNKNOWN = ("ax",)  # what a letter becomes of which nothing is known: the mouth at ease, slightly open


def find_spelling(labels: Sequence[str]) -> dict[str, str]:
    """Return the IPA of phones in romaji, or in pinyin with tones, if all are such; none of any other.

    >>> find_spelling(["k", "o", "N", "ch", "i"])["ch"], find_spelling(["h", "ao3"])["ao3"], find_spelling(["k", "o"])
    ('tʃ', 'aʊ', {})
    """
    if ONLY_ROMAJI & {*labels} and {*labels} <= ROMAJI.keys():
        return ROMAJI
    plain = {label: re.sub(r"(?<=[a-zü])[1-5]$", "", label) for label in labels}
    is_pinyin = any(plain[label] != label for label in labels) and {*plain.values()} <= PINYIN.keys()
    return {label: PINYIN[name] for label, name in plain.items()} if is_pinyin else {}


@cache
def xsampa_to_ipa(label: str) -> str:
    """Return a phone in X-SAMPA in IPA; empty: it is no single phone in X-SAMPA.

    A phone is one consonant or vowel with its marks, a stop with the fricative that it opens to, or a diphthong.

    >>> xsampa_to_ipa("@U"), xsampa_to_ipa("t_h"), xsampa_to_ipa("4"), xsampa_to_ipa("word")
    ('əʊ', 't', 'ɾ', '')
    """
    symbols, at = [], 0
    while at < len(label):
        symbol = _XSAMPA_SYMBOL.match(label, at)
        if symbol is None:
            return ""
        symbols.append(XSAMPA.get(symbol[0], ""))
        at = symbol.end()
    bases = [symbol for symbol in symbols if symbol not in ("", "ʷ") and not is_mark(symbol[0])]
    vowels = all(symbol[0] in VOWEL_CHART for symbol in bases) and len(bases) < 4
    opened = len(bases) == 2 and bases[0] in "ptdkb" and bases[1] in "fvθðszʃʒxçhʂʐɕʑ"
    single = len(bases) == 1 or opened or (vowels and len({*bases}) == len(bases))
    return "".join(symbols).replace("ʰ", "") if single else ""


@cache
def read_ipa(label: str) -> tuple[tuple[str, ...], str]:
    """Return the phones of the inventory for a phone in IPA, and those of its letters that are in no table.

    A letter with marks that is in no table is the letter without them; any other becomes ax. A token of a recogniser
    that is no sound (``<blank>``), and a change of language (``(en)``), have no phone.

    >>> read_ipa("ˈyː"), read_ipa("p͡f"), read_ipa("t͡ʃ")
    ((('uw',), ''), (('p', 'f'), ''), (('ch',), ''))
    """
    phones, unknown = _read([label])
    return tuple(phone for phone, _ in phones), unknown


def read_tokens(tokens: Sequence[str]) -> list[tuple[str, int]]:
    """Return the phones of the tokens of a recogniser, in order, each with the number of the token that it begins in.

    Tokens that are one sound together are one: ``t``, ``͡``, ``ʃ``; ``a``, ``ɪ``; but not beyond a token that is no
    sound, as ``<wb>``. Marks belong to the token before.

    >>> read_tokens(["t", "͡", "ʃ", "a", "<wb>", "ɪ"])
    [('ch', 0), ('aa', 3), ('ih', 5)]
    """
    return _read(tokens)[0]


def _read(tokens: Sequence[str]) -> tuple[list[tuple[str, int]], str]:
    """Return phones with the numbers of their tokens, and letters that are in no table."""
    letters: list[tuple[str, int]] = []
    for number, token in enumerate(tokens):
        if token.startswith("("):
            continue
        no_sound = len(token) > 1 and token.startswith("<")
        spelt = "|" if no_sound else unicodedata.normalize("NFD", token).translate(_TIES)
        letters += [(letter, number) for letter in spelt]
    text = "".join(letter for letter, _ in letters)
    phones: list[tuple[str, int]] = []
    unknown, at = "", 0
    while at < len(text):
        symbol = next((text[at : at + n] for n in range(_LONGEST, 0, -1) if text[at : at + n] in IPA_PHONES), "")
        if symbol:
            phones += [(phone, letters[at][1]) for phone in IPA_PHONES[symbol]]
        elif not is_mark(text[at]):
            phones += [(phone, letters[at][1]) for phone in UNKNOWN]
            unknown += text[at]
        at += len(symbol) or 1
    return phones, unknown


def is_mark(letter: str) -> bool:
    """Return whether a letter is a mark without a mouth shape: of length, tone, stress, or the way of speaking."""
    marked = letter in _IGNORED or unicodedata.category(letter) in ("Mn", "Sk", "Lm", "Cf", "Zs")
    return marked and letter not in IPA_PHONES
