"""The letters of words: in one form of writing, and read by rules where a word is in no dictionary."""

from __future__ import annotations

import re
import unicodedata
from pathlib import Path

from lipmotion.errors import InputError, shorten


def parse_table(rows: str) -> dict[str, str]:
    """Return a table of ``key=value`` between blanks; an underscore in a value is a blank."""
    return {key: value.replace("_", " ") for key, _, value in (row.partition("=") for row in rows.split())}


def read_table(name: str) -> dict[str, str]:
    """Return a table of the package (``tables/NAME.tsv``): a key, a tab and a value a line; ``# `` begins a comment."""
    return _read_rows(Path(__file__).with_name("tables") / f"{name}.tsv")


def read_patterns(path: Path) -> dict[str, re.Pattern[str]]:
    """Return the regular expressions of a table as of ``read_table``; ``<NAME>`` in one is that of a row before.

    Rows whose names begin with an underscore are pieces of others alone.
    """
    patterns: dict[str, str] = {}
    for name, form in _read_rows(path).items():
        patterns[name] = re.sub("<([A-Z_]{3,})>", lambda piece: patterns[piece[1]], form)
    return {name: re.compile(pattern) for name, pattern in patterns.items() if name[0] != "_"}


def _read_rows(path: Path) -> dict[str, str]:
    text = path.read_text(encoding="utf-8")
    rows = (line.partition("\t") for line in text.splitlines() if not line.startswith("# "))
    return {key: value for key, _, value in rows}


SPELLINGS = read_table("spellings")
"""The longest match from the left wins. ARPAbet, lower case; an empty value is a silent letter."""
LONG_VOWELS = {"a": "ey", "e": "iy", "i": "ay", "o": "ow", "u": "uw"}
ACCENTS = re.compile("[\u0300-\u036f]")  # the accents of Latin letters; the marks of other scripts are sounds
_LONGEST = max(map(len, SPELLINGS))


MAX_MARKS = 30  # largest number of accents on one letter; no language has so many
MARKS = read_patterns(Path(__file__).with_name("tables") / "letters.tsv")
"""Patterns of apostrophes and of what is not said or raised, by their names in the table."""
DASHES = str.maketrans({"‐": "-", "‒": "-", "²": " squared", "³": " cubed", "∞": " infinity ", "√": " root ", "″": '"'})
PLAIN = str.maketrans({"ß": "ss", "æ": "ae", "œ": "oe", "ø": "o", "đ": "d", "ð": "th", "þ": "th", "ł": "l", "ı": "i"})
"""Letters of Latin alphabets that Unicode does not divide into a letter and an accent."""


def convert_to_plain(text: str) -> str:
    """Return a text in NFKC form (``2½``: ``2 1⁄2``), with straight apostrophes, without invisible characters."""
    if not text.isascii():
        marks = re.escape("".join(c for c in set(text) if unicodedata.combining(unicodedata.normalize("NFKD", c)[0])))
        if marks:  # at most so many on a letter, as Unicode Standard Annex 15: they are sorted in quadratic time
            text = re.sub(f"([{marks}]{{{MAX_MARKS}}})[{marks}]+", r"\1", text)
        text = re.sub(r"(?<=\d)(?=[¼-¾⅐-⅞])", " ", MARKS["UNSPOKEN"].sub("", MARKS["APOSTROPHES"].sub("'", text)))
        text = MARKS["POWERS"].sub(
            lambda power: f"^{unicodedata.normalize('NFKC', power[0])}", MARKS["NOTES"].sub("", text)
        )
        text = unicodedata.normalize("NFKC", text.translate(DASHES)).translate(DASHES)
        text = "".join(letter for letter in text if unicodedata.category(letter) != "Cf")
        text = re.sub(r"\d", lambda digit: str(int(digit[0])), text)
    return text.replace("`", "'")


def normalise_text(text: str) -> str:
    """Return a text as ``convert_to_plain`` does, in lower case."""
    return convert_to_plain(text).lower()


def remove_accents(word: str) -> str:
    """Return a lower-case word in plain letters, as far as its letters are Latin: ``café`` as ``cafe``."""
    if word.isascii():
        return word
    divided = unicodedata.normalize("NFKD", word.translate(PLAIN))
    return "".join(letter for letter in divided if not ACCENTS.fullmatch(letter))


def guess_pronunciation(word: str) -> tuple[str, ...]:
    """Return a guessed pronunciation of a word in ARPAbet, without its accents. Raises InputError: not in Latin."""
    plain = remove_accents(word)
    foreign = sorted(letter for letter in set(word) if re.search(r"[^a-z']", remove_accents(letter)))
    if foreign or not plain.strip("'"):
        what = f"cannot guess how {shorten(word)!r} is said ({shorten(' '.join(foreign)) or 'no letters'}):"
        raise InputError(f"{what} give the language of the words (--language), or add it to a lexicon file")
    phones: list[str] = []
    letters = re.sub(r"([b-df-hj-np-tv-z])\1+", r"\1", plain)  # doubled consonants sound once
    at = 0
    while at < len(letters):
        if phones and MARKS["SILENT_E"].fullmatch(letters, at):
            phones += ["z"] * letters.endswith("s")
            break
        if MARKS["LONG_VOWEL"].match(letters, at):
            phones.append(LONG_VOWELS[letters[at]])
            at += 1
            continue
        size = next(n for n in range(_LONGEST, 0, -1) if letters[at : at + n] in SPELLINGS)
        phones += SPELLINGS[letters[at : at + size]].split()
        at += size
    has_vowel = re.search("[aeiouy]", plain)
    return tuple("er" if phone == "r" and not has_vowel else phone for phone in phones)  # the vowel of "brr"
