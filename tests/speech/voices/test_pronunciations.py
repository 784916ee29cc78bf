"""Words of other languages are pronounced by their own rules, or not at all."""

from __future__ import annotations

import re

import pytest

from lipmotion.errors import InputError, MissingDependencyError
from lipmotion.speech.voices import espeak
from lipmotion.speech.voices.espeak import LanguageLexicon
from lipmotion.types.languages import ENGLISH, LANGUAGES
from lipmotion.units import PHONES

INSTALLED = espeak.wheel_folder() is not None
WORDS = {
    "es": {"lobo": "l ow v ow", "cigüeña": "th iy g uw eh n aa"},
    "fr": {"rue": "hh uw", "l'œuf": "l ao f"},
    "de": {"schöne": "sh ow n ax", "12": "t s v ao l f"},
    "ja": {"ふゆ": "f uh y uh"},
    "ko": {"밥을": "p aa p ix l"},
    "zh": {"吗": "m aa", "个": "k ax"},
    "ru": {"мир": "m iy r"},
}


@pytest.mark.usefixtures("bare")
def test_without_rules_only_the_users_words_are_pronounced() -> None:
    lexicon = LanguageLexicon({"perro": (("p", "eh", "r", "ow"),)}, "es")
    assert lexicon.with_words(("perro", "perro")) is lexicon
    with pytest.raises(MissingDependencyError, match=re.escape("no pronunciation of 'gato' in Spanish: install")):
        lexicon.with_words(("perro", "gato"))


@pytest.mark.usefixtures("bare")
def test_letters_of_another_script_are_refused() -> None:
    for language, word in (("ja", "東京"), ("es", "привет"), ("zh", "こ")):
        with pytest.raises(InputError, match="no rules say how"):
            LanguageLexicon({}, language).pronunciations(word)


@pytest.mark.skipif(not INSTALLED, reason="the package espeakng-loader is not installed")
class TestPackage:
    """The rules of espeak-ng, of the Python package."""

    @pytest.mark.parametrize("language", ["es", *(pytest.param(each, marks=pytest.mark.long) for each in [*WORDS][1:])])
    def test_rules_of_the_language(self, language: str) -> None:
        words = WORDS[language]
        lexicon = LanguageLexicon({}, language).with_words(tuple(words))
        assert {word: " ".join(lexicon.pronunciations(word)[0]) for word in words} == words

    @pytest.mark.long
    def test_every_language_has_a_voice(self) -> None:
        for language in LANGUAGES.keys() - {ENGLISH}:
            phones = LanguageLexicon({}, language).pronunciations("2")[0]
            assert phones
            assert {*phones} <= {*PHONES}
