"""Letter-to-sound rules: a guess for words that no dictionary has."""

from __future__ import annotations

import re

from lipmotion.errors import InputError

SPELLINGS: dict[str, str] = {
    # The longest match from the left wins. ARPAbet, lower case; an empty value is a silent letter.
    "tion": "sh ah n",
    "sion": "zh ah n",
    "ture": "ch er",
    "ough": "ao",
    "augh": "ao",
    "eigh": "ey",
    "igh": "ay",
    "tch": "ch",
    "dge": "jh",
    "sch": "sh",
    "ee": "iy",
    "ea": "iy",
    "ie": "iy",
    "ei": "ey",
    "ai": "ey",
    "ay": "ey",
    "ey": "iy",
    "oa": "ow",
    "oo": "uw",
    "ou": "aw",
    "ow": "ow",
    "oi": "oy",
    "oy": "oy",
    "au": "ao",
    "aw": "ao",
    "ew": "uw",
    "ue": "uw",
    "ar": "aa r",
    "er": "er",
    "ir": "er",
    "or": "ao r",
    "ur": "er",
    "ch": "ch",
    "ck": "k",
    "gh": "g",
    "kn": "n",
    "ng": "ng",
    "ph": "f",
    "qu": "k w",
    "rh": "r",
    "sh": "sh",
    "th": "th",
    "wh": "w",
    "wr": "r",
    "ce": "s eh",
    "ci": "s ih",
    "cy": "s iy",
    "ge": "jh eh",
    "a": "ae",
    "b": "b",
    "c": "k",
    "d": "d",
    "e": "eh",
    "f": "f",
    "g": "g",
    "h": "hh",
    "i": "ih",
    "j": "jh",
    "k": "k",
    "l": "l",
    "m": "m",
    "n": "n",
    "o": "aa",
    "p": "p",
    "q": "k",
    "r": "r",
    "s": "s",
    "t": "t",
    "u": "ah",
    "v": "v",
    "w": "w",
    "x": "k s",
    "y": "iy",
    "z": "z",
    "'": "",
}
LONG_VOWELS = {"a": "ey", "e": "iy", "i": "ay", "o": "ow", "u": "uw"}
_LONGEST = max(map(len, SPELLINGS))


def guess(word: str) -> tuple[str, ...]:
    """Return a guessed pronunciation of a lower-case word, in ARPAbet.

    Raises InputError: a character is not a letter of the English alphabet.
    """
    foreign = sorted(set(re.sub(r"[a-z']", "", word)))
    if foreign or not word.strip("'"):
        raise InputError(
            f"cannot guess how {word!r} is said ({' '.join(foreign) or 'no letters'}): add it to a lexicon file"
        )
    phones: list[str] = []
    rest = re.sub(r"([b-df-hj-np-tv-z])\1", r"\1", word)  # doubled consonants sound once
    while rest:
        taken, sound = _next_sound(rest, begun=bool(phones))
        phones += sound.split()
        rest = rest[taken:]
    return tuple(phones)


def _next_sound(rest: str, *, begun: bool) -> tuple[int, str]:
    """Return how many letters are used up, and their sound."""
    if re.fullmatch(r"e'?s?", rest) and begun:  # final e is silent
        return len(rest), "z" if rest.endswith("s") else ""
    if re.match(r"[aeiou][bcdfgklmnpstvz]e('?s)?$", rest):  # vowel, consonant, final e: a long vowel
        return 1, LONG_VOWELS[rest[0]]
    size = next(n for n in range(_LONGEST, 0, -1) if rest[:n] in SPELLINGS and len(rest) >= n)
    return size, SPELLINGS[rest[:size]]
