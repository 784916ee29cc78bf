from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.errors import InputError
from lipmotion.units import PHONES, Lexicon, is_silent
from lipmotion.units.spelling import SPELLINGS, guess_pronunciation, without_accents

LETTERS = "abcdefghijklmnopqrstuvwxyz"


@pytest.mark.parametrize(
    ("word", "phones"),
    [
        ("bim", "b ih m"),
        ("blip", "b l ih p"),
        ("shab", "sh ae b"),
        ("phab", "f ae b"),
        ("quib", "k w ih b"),
        ("gloke", "g l ow k"),  # final e is silent and makes the vowel long
        ("glokes", "g l ow k z"),
        ("tibber", "t ih b er"),  # doubled consonants sound once
        ("blation", "b l ae sh ah n"),
        ("fitch", "f ih ch"),
        ("knig", "n ih g"),
        ("o'bim", "aa b ih m"),
        ("e", "eh"),
        ("es", "eh s"),
    ],
)
def test_rules(word: str, phones: str) -> None:
    assert " ".join(guess_pronunciation(word)) == phones


def test_every_rule_gives_phones_of_the_inventory() -> None:
    for sound in SPELLINGS.values():
        assert set(sound.split()) <= set(PHONES)
    assert set(LETTERS) <= set(SPELLINGS)


@settings(max_examples=300)
@given(st.text(LETTERS, min_size=1, max_size=20))
def test_any_word_can_be_said(word: str) -> None:
    phones = guess_pronunciation(word)
    assert phones
    assert all(phone in PHONES and not is_silent(phone) for phone in phones)


@settings(max_examples=100)
@given(st.text(LETTERS + "'", min_size=1, max_size=12).filter(lambda word: word.strip("'")))
def test_the_lexicon_knows_how_any_word_is_said(word: str) -> None:
    variants = Lexicon().pronunciations(word)
    assert variants
    assert all(set(variant) <= set(PHONES) for variant in variants)
    assert all(variants)


@pytest.mark.parametrize(
    ("word", "plain"),
    [
        ("grögu", "grogu"),
        ("naïveté", "naivete"),
        ("ångström", "angstrom"),
        ("straße", "strasse"),
        ("søren", "soren"),
        ("łódź", "lodz"),
        ("e\u0301te\u0301", "ete"),
        ("plain", "plain"),
        ("kā́", "ka"),
    ],
)
def test_accents_are_left_out(word: str, plain: str) -> None:
    assert without_accents(word) == plain
    assert guess_pronunciation(word) == guess_pronunciation(plain)


def test_a_word_with_accents_is_said_as_the_dictionary_says_it_without() -> None:
    lexicon = Lexicon()
    assert lexicon.pronunciations("café") == lexicon.pronunciations("cafe")
    assert not lexicon.known("café")  # which is reported
    assert Lexicon({"café": (("k", "ae"),)}).pronunciations("café") == (("k", "ae"),)


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("日本", r"how '日本' is said \(日 本\): add it to a lexicon file"),
        ("éкран", r"\(а к н р\)"),
        ("한", r"\(한\)"),
        ("mp3", r"\(3\)"),
        ("''", r"\(no letters\)"),
        ("", r"\(no letters\)"),
    ],
)
def test_it_says_what_it_cannot_guess(word: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        guess_pronunciation(word)


@pytest.mark.parametrize("word", ["ж" * 1000, "".join(map(chr, range(0x3B1, 0x3C9))) * 100 + "日" * 90])
def test_a_message_repeats_the_beginning_of_a_word(word: str) -> None:
    with pytest.raises(InputError, match=r"\.\.\.' is said") as caught:
        guess_pronunciation(word)
    assert len(str(caught.value)) < 300
