import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion import errors, units
from lipmotion.units.spelling import guess_pronunciation, remove_accents

LETTERS = "abcdefghijklmnopqrstuvwxyz"


def test_rules() -> None:
    for word, phones in (
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
    ):
        assert " ".join(guess_pronunciation(word)) == phones


@settings(max_examples=60)
@given(st.text(LETTERS, min_size=1, max_size=20))
def test_any_word_can_be_said(word: str) -> None:
    phones = guess_pronunciation(word)
    assert phones
    assert all(phone in units.PHONES and not units.is_silent(phone) for phone in phones)


def test_accents_are_left_out() -> None:
    for word, plain in (
        ("grögu", "grogu"), ("naïveté", "naivete"), ("ångström", "angstrom"), ("straße", "strasse"),
        ("søren", "soren"), ("łódź", "lodz"), ("e\u0301te\u0301", "ete"), ("plain", "plain"), ("kā́", "ka"),
    ):  # fmt: skip
        assert remove_accents(word) == plain
        assert guess_pronunciation(word) == guess_pronunciation(plain)


def test_a_word_with_accents_is_said_as_the_dictionary_says_it_without() -> None:
    lexicon = units.Lexicon()
    assert lexicon.pronunciations("café") == lexicon.pronunciations("cafe")
    assert all(map(lexicon.known, "café zoë josé renée naïve señor".split()))
    assert not lexicon.known("grögu")
    assert units.Lexicon({"café": (("k", "ae"),)}).pronunciations("café") == (("k", "ae"),)


def test_it_says_what_it_cannot_guess() -> None:
    for word, message in (
        ("日本", r"how '日本' is said \(日 本\): give the language of the words \(--language\), or add it"),
        ("éкран", r"\(а к н р\)"), ("한", r"\(한\)"), ("mp3", r"\(3\)"), ("''", r"\(no letters\)"),
        ("", r"\(no letters\)"),
    ):  # fmt: skip
        with pytest.raises(errors.InputError, match=message):
            guess_pronunciation(word)


def test_a_message_repeats_the_beginning_of_a_word() -> None:
    for word in ("ж" * 1000, "".join(map(chr, range(0x3B1, 0x3C9))) * 100 + "日" * 90):
        with pytest.raises(errors.InputError, match=r"\.\.\.' is said") as caught:
            guess_pronunciation(word)
        assert len(str(caught.value)) < 300
