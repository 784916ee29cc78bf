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

HEIGHTS = ("close", "near-close", "close-mid", "mid", "open-mid", "near-open", "open")


class Vowel(NamedTuple):
    """A vowel of the chart: its height (0: close, to 6: open), whether it is rounded, and its phone."""

    height: int
    rounded: bool
    phone: str


_UNROUNDED = {
    "close": "i iy  ɨ ix  ᵻ ix  ɯ ix", "near-close": "ɪ ih", "close-mid": "e eh  ɘ ax  ɤ ax", "mid": "ə ax  ɚ axr",
    "open-mid": "ɛ eh  ε eh  ɜ ah  ɝ er  ʌ ah", "near-open": "æ ae  ɐ aa", "open": "a aa  ɑ aa  A aa",
}  # fmt: skip
_ROUNDED = {
    "close": "y uw  ʉ uw  u uw", "near-close": "ʏ uh  ʊ uh", "close-mid": "ø ow  ɵ ow  o ow",
    "open-mid": "œ ao  ɞ ao  ɔ ao", "open": "ɶ ao  ɒ ao",
}  # fmt: skip
VOWEL_CHART: dict[str, Vowel] = {
    letter: Vowel(HEIGHTS.index(height), rounded, phone)
    for rounded, rows in ((False, _UNROUNDED), (True, _ROUNDED))
    for height, row in rows.items()
    for letter, phone in zip(row.split()[::2], row.split()[1::2], strict=True)
}
"""The vowels, front to back in every row. A rounded one has the phone of its height, wherever the tongue is."""
_OTHERS: dict[str, str] = {
    # diphthongs; a long eː is as close at its end as ey; Japanese ɯᵝ is rounded a little; o- is espeak-ng's Mandarin ɤ
    "aɪ ai": "ay", "aʊ au ɑu": "aw", "ɔɪ ɔʏ ɔy oɪ oi": "oy", "eɪ ei ɛɪ eː": "ey", "oʊ əʊ ou": "ow", "ɯᵝ": "uh",
    "ə˞": "axr", "ɜ˞": "er", "˞": "r", "o-": "ax",
    # both lips; the fricatives ɸ and β do not close them, the trill ʙ does; ʷ: the lips round
    "p ʘ": "p", "b ɓ ʙ": "b", "m": "m", "ɸ Φ pɸ": "f", "β": "v", "w ʍ ɥ ʷ": "w",
    # lip and teeth
    "f": "f", "v ʋ ɱ ⱱ": "v",
    # tip of the tongue: at the teeth, behind them, further back (ʃ and its like round the lips)
    "θ": "th", "ð": "dh", "t ʈ ǀ ǃ ǁ": "t", "d ɖ ɗ ɾ": "d", "n ɲ ɳ": "n", "s": "s", "z": "z", "ʦ": "t s", "ʣ": "d z",
    "l ɫ ɭ ʎ ɬ ɮ ɺ ʟ": "l", "r ɹ ɽ ɻ": "r", "ʃ ɕ ʂ S": "sh", "ʒ ʑ ʐ": "zh", "tʃ tɕ tʂ ʧ": "ch", "dʒ dʑ dʐ ʤ": "jh",
    # back of the tongue, throat: the lips are those of the vowels beside
    "j ç ʝ": "y", "k c q x χ ɧ": "k", "g ɡ ɟ ɢ ɠ ɣ ɰ ʛ ʄ": "g", "ŋ ɴ": "ng", "h ɦ ħ ʕ ʁ ʀ ʜ ʢ": "hh",
    # consonants that are a syllable; a stop of the throat
    "l̩": "el", "m̩": "em", "n̩": "en", "ʔ ʡ": "",
    # letters of Mandarin that recognisers write as they are: yi, bu
    "一": "iy", "不": "b uw",
}  # fmt: skip
IPA_PHONES: dict[str, tuple[str, ...]] = {letter: (vowel.phone,) for letter, vowel in VOWEL_CHART.items()} | {
    unicodedata.normalize("NFD", symbol): tuple(phones.split())
    for symbols, phones in _OTHERS.items()
    for symbol in symbols.split()
}
"""IPA symbols to phones of the inventory; the longest symbol counts."""
_LONGEST = max(map(len, IPA_PHONES))
_SAMPA = (
    "A ɑ B β C ç D ð E ɛ F ɱ G ɣ H ɥ I ɪ J ɲ K ɬ L ʎ M ɯ N ŋ O ɔ P ʋ Q ɒ R ʁ S ʃ T θ U ʊ V ʌ W ʍ X χ Y ʏ Z ʒ @ ə { æ "
    "} ʉ 1 ɨ 2 ø 3 ɜ 4 ɾ 5 ɫ 6 ɐ 7 ɤ 8 ɵ 9 œ & ɶ ? ʔ g ɡ = ̩ ~ ̃ : ː ' ʲ \" ˈ % ˌ ! ꜜ | | . . "
    "B\\ ʙ G\\ ɢ H\\ ʜ I\\ ᵻ J\\ ɟ K\\ ɮ L\\ ʟ M\\ ɰ N\\ ɴ O\\ ʘ R\\ ʀ U\\ ʊ X\\ ħ h\\ ɦ j\\ ʝ l\\ ɺ p\\ ɸ r\\ ɹ "
    "s\\ ɕ v\\ ʋ x\\ ɧ z\\ ʑ 3\\ ɞ @\\ ɘ ?\\ ʕ <\\ ʢ >\\ ʡ |\\ ǀ |\\|\\ ǁ !\\ ǃ =\\ ǃ :\\ ˑ -\\ ‿ r\\` ɻ "
    "d` ɖ l` ɭ n` ɳ r` ɽ s` ʂ t` ʈ z` ʐ @` ɚ 3` ɝ b_< ɓ d_< ɗ g_< ɠ G\\_< ʛ J\\_< ʄ _= ̩ _~ ̃ _w ʷ _j ʲ _h ʰ tS tʃ dZ dʒ"
).split()  # fmt: skip
XSAMPA = dict(zip(_SAMPA[::2], _SAMPA[1::2], strict=True)) | {letter: letter for letter in "abcdefhijklmnopqrstuvwxyz"}
"""X-SAMPA's symbols, and so SAMPA's of WebMAUS, in IPA. Source: J. C. Wells, "Computer-coding the IPA", 1995, 2000."""
_XSAMPA_SYMBOL = re.compile("|".join(map(re.escape, sorted(XSAMPA, key=len, reverse=True))) + r"|_[^\s\\]\\?|[`^-]")
_IGNORED = frozenset("'#\"ˈˌː.|‿^-_*!?;:,~%<>ˑʰʲˤˠʼʱⁿˡ0123456789()¹²³⁰⁴⁵⁻⁽⁾")
"""Marks that no mouth shape depends on; further ones are combining marks and tones."""
_TIES = str.maketrans("", "", "͜͡")
UNKNOWN = ("ax",)  # what a letter becomes of which nothing is known: the mouth at ease, slightly open


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
