"""Pronunciations of the words of other languages, by the rules of espeak-ng, in the phones of the inventory."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from lipmotion.errors import InputError, MissingDependencyError, shorten
from lipmotion.extensions import install_command
from lipmotion.speech.voices.espeak import EXTRA, pronounced_words
from lipmotion.types.languages import ENGLISH, LANGUAGES, foreign_letters
from lipmotion.units import Lexicon, Pronunciation
from lipmotion.units.ipa_phones import read_ipa
from lipmotion.units.lexicon import SpokenForm

MAPPED_CONFIDENCE = 0.8
"""Most confidence in words of another language: their phones are the nearest ones of English, on which models are
trained. 0.80 of the phones of espeak-ng's sentences in nine languages are phones of English as well
(docs/results/languages.md)."""


@dataclass(frozen=True)
class LanguageLexicon(Lexicon):
    """Pronunciations of the words of a language that is not English: the user's, then those of espeak-ng.

    language : its code, of ``LANGUAGES``

    >>> LanguageLexicon({"perro": (("p", "eh", "r", "ow"),)}, "es").pronunciations("perro")
    (('p', 'eh', 'r', 'ow'),)
    """

    language: str = ENGLISH

    def known(self, word: str) -> bool:
        """Return whether the word has a pronunciation: none is guessed. Raises as ``with_words``."""
        return bool(self.spoken_forms(word))

    def spoken_forms(self, word: str) -> tuple[SpokenForm, ...]:
        """Return every pronunciation of a lower-case word, each phone with the word. Raises as ``with_words``."""
        variants = self.user.get(word) or self.with_words((word,)).user[word]
        return tuple(tuple((phone, word) for phone in variant) for variant in variants)

    def with_words(self, words: Sequence[str]) -> LanguageLexicon:
        """Return the same lexicon that holds the pronunciations of some words; espeak-ng is asked once for all.

        Raises MissingDependencyError: espeak-ng is not installed, and the user's lexicon lacks a word.
        Raises InputError: a word in letters that its language is not written in, or that has no phone.
        """
        missing = [word for word in dict.fromkeys(words) if word not in self.user]
        return replace(self, user=self.user | _pronounced(missing, self.language)) if missing else self


def _pronounced(words: Sequence[str], language: str) -> dict[str, tuple[Pronunciation, ...]]:
    """Return the pronunciations of words, by word. Raises as ``LanguageLexicon.with_words``."""
    spoken = LANGUAGES[language]
    for word in words:
        if letters := foreign_letters(word, language):
            raise InputError(
                f"no rules say how {shorten(repr(word))} is said in {spoken.name} ({shorten(letters)}): write it "
                f"as it is spoken ({' or '.join(spoken.scripts).lower()} letters), add it to a lexicon file, or give "
                "another language"
            )
    try:
        said = zip(words, pronounced_words(words, spoken.voice or language), strict=True)
        found: dict[str, tuple[Pronunciation, ...]] = {
            word: (tuple(phone for label in re.split(r"[|\s]+", ipa) for phone in read_ipa(label)[0]),)
            for word, ipa in said
        }
    except MissingDependencyError as error:
        raise MissingDependencyError(
            f"no pronunciation of {shorten(repr(words[0]))} in {spoken.name}: install espeak-ng "
            f"({install_command(EXTRA)}), or give a lexicon file with its {len(words)} words"
        ) from error
    silent = next((word for word, (phones,) in found.items() if not phones), None)
    if silent is not None:
        raise InputError(f"{shorten(repr(silent))} has no phone in {spoken.name}; add it to a lexicon file")
    return found
