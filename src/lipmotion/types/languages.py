"""The languages that speech may be in: their codes, names, scripts, and what espeak-ng calls them."""

from __future__ import annotations

import csv
import unicodedata
from importlib import resources
from typing import NamedTuple

ENGLISH, AUTO = "en", "auto"


class Language(NamedTuple):
    """A language: its name, the scripts that it is written in, as Unicode names them, and espeak-ng's name of it."""

    name: str
    scripts: tuple[str, ...]
    voice: str


_ROWS = csv.reader(resources.files(__package__).joinpath("languages.csv").read_text(encoding="ascii").splitlines()[1:])
LANGUAGES = {code: Language(name, tuple(scripts.split()), voice) for code, name, scripts, voice in _ROWS}
"""By their code of ISO 639-1. Not in it: languages whose script espeak-ng was not tried on."""


def find_script(letter: str) -> str:
    """Return the script of a letter, as Unicode's names begin: ``LATIN``, ``CJK``; empty: it is no letter."""
    if not unicodedata.category(letter).startswith("L"):
        return ""
    return unicodedata.name(letter, "").partition(" ")[0].partition("-")[0]


def find_foreign(word: str, language: str) -> str:
    """Return the letters of a word that its language is not written in. Latin letters are read in every language."""
    known = ("", "LATIN", *LANGUAGES[language].scripts)
    return "".join(dict.fromkeys(letter for letter in word if find_script(letter) not in known))
