import json
import unicodedata
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion import units
from lipmotion.errors import AlignmentError, InputError
from lipmotion.units import lexicon, text_normalisation
from lipmotion.units.text_normalisation import (
    ALWAYS_ALLOWED_CHARACTERS,
    ALWAYS_ALLOWED_PHONES,
    CHARACTERS_PER_S,
    LONGEST_SENTENCE,
    LONGEST_WORD,
    MAX_CHARACTERS,
    PHONES_PER_S,
    clean_text,
    split_sentences,
)
from lipmotion.units.written_forms import ONES, SCALES, TENS, spell_number

TEXTS = json.loads(Path(__file__).with_name("said_texts.json").read_text("utf-8"))
ANY = st.one_of(st.integers(32, 126), st.integers(0, 0xD7FF), st.integers(0xE000, 0x10FFFF)).map(chr)
"""Any character. The tables by which Hypothesis chooses one by its kind take a second and 200 MB."""


def test_a_text_without_words_is_refused() -> None:
    for text in ("", "   \n", "...", "—", "'", "’’", "🙂", "_"):
        with pytest.raises(InputError, match="holds no word; give the words that are spoken"):
            units.split_words(text)


def test_numbers() -> None:
    for digits, words in (
        ("0", "zero"), ("1000000001", "one billion one"), ("1000000000000", "one" + " zero" * 12), ("00", "zero zero"),
    ):  # fmt: skip
        assert " ".join(spell_number(digits)) == words
    assert units.split_words("7" * 10_000) == ("seven",) * 10_000  # numbers of any length are digits


@settings(max_examples=60)
@given(st.integers(0, 10**12 - 1))
def test_a_number_comes_back_from_its_words(number: int) -> None:
    values = {word: n for n, word in enumerate(ONES)} | {word: 10 * n for n, word in enumerate(TENS) if n > 1}
    scales = {name: scale for scale, name in SCALES}
    total = part = 0
    for word in spell_number(str(number)):
        if word == "hundred":
            part *= 100
        elif word in scales:
            total, part = total + part * scales[word], 0
        else:
            part += values[word]
    assert total + part == number


@settings(max_examples=60)
@given(st.text(ANY, max_size=60))
def test_any_text_gives_words_or_says_that_there_are_none(text: str) -> None:
    try:
        words = units.split_words(text)
    except InputError:
        return
    assert words
    for word in words:
        assert word == word.lower()
        assert not any(character.isspace() or character.isdecimal() for character in word)
    assert units.split_words(" ".join(words)) == words


def test_a_letter_keeps_thirty_marks() -> None:
    """More would be sorted, which takes the square of the time; half-width and Tibetan marks hide what they are."""
    for mark in ("\u0301", "\u0316\u0301", "\u0f73", "\uff9e"):
        many = "a" + mark * 200_000
        kept = "a" + (mark * 200_000)[: units.spelling.MAX_MARKS]
        assert units.spelling.normalise_text(many) == unicodedata.normalize("NFKC", kept)
        assert units.spelling.normalise_text("e\u0301" * 100) == "é" * 100


def test_a_text_may_be_as_long_as_can_be_said() -> None:
    for duration_s in (0.0, 1.0, 3600.0):
        most = ALWAYS_ALLOWED_CHARACTERS + int(CHARACTERS_PER_S * duration_s)
        units.check_text("a" * most, duration_s)
        with pytest.raises(AlignmentError, match=f"{most + 1} characters, .* at most {most} for {duration_s:.2f} s"):
            units.check_text("a" * (most + 1), duration_s)
    units.check_text("strong " * 655 * 60, 3600.0)  # the fastest speech on record: 655 words a minute, for an hour


def test_words_count_with_the_blanks_between_them() -> None:
    units.check_words(["a"] * (ALWAYS_ALLOWED_CHARACTERS // 2), 0.0)
    with pytest.raises(AlignmentError, match=f"has {ALWAYS_ALLOWED_CHARACTERS + 2} characters.*the words of this"):
        units.check_words(["a"] * (ALWAYS_ALLOWED_CHARACTERS // 2 + 1), 0.0)


def test_phones_are_no_more_than_frames() -> None:
    most = ALWAYS_ALLOWED_PHONES + 2 * PHONES_PER_S
    units.check_phones(most, 2.0)
    with pytest.raises(InputError, match=f"{most + 1} units in time, required at most {most} for 2.00 s of sound"):
        units.check_phones(most + 1, 2.0)


def test_sentences() -> None:
    for text, sentences in TEXTS["sentences"]:
        assert split_sentences(text) == sentences


def test_a_long_sentence_is_divided_at_a_comma_else_between_words_else_anywhere() -> None:
    clause = "a b c d e f g h " * 15
    first, second = split_sentences(f"{clause}, {clause}.")
    assert first.endswith("h ,")
    assert second.endswith("h .")
    parts = split_sentences("word " * 200)
    assert max(map(len, parts)) <= LONGEST_SENTENCE
    assert " ".join(parts) == ("word " * 200).strip()
    assert [len(part) for part in split_sentences("好" * 900)] == [400, 400, 100]  # a script without blanks


@settings(max_examples=50)
@given(st.text(ANY, max_size=300))
def test_no_word_is_lost_or_made(text: str) -> None:
    words = units.find_words(clean_text(text))
    if words:
        parts = split_sentences(text)
        assert tuple(word for part in parts for word in units.find_words(part)) == words
    else:
        with pytest.raises(InputError, match="holds no word"):
            split_sentences(text)


def test_what_cannot_be_said() -> None:
    for text, message in (
        ("", "'' holds no word; give the words to be spoken"),
        (" \t\n", "holds no word"),
        ("... 🙂 !", "holds no word"),
        ("x" * (LONGEST_WORD + 1), "a word of 201 characters .*required at most 200"),
        ("a " * MAX_CHARACTERS, "has 100000 characters, required at most 50000, about an hour of speech"),
    ):
        with pytest.raises(InputError, match=message):
            split_sentences(text)


ENGLISH = ["b l uw m", "k ax n f y uw z d", "w ih z axr d", "b ih hh ay n d", "k er t ax n", "l eh f t"]
SPANISH = ["l eh s ao f", "k ow s t ow", "k ax s ih t iy", "p er ao t ax", "ih s ax l m", "m ae n iy f"]


def test_of_a_text() -> None:
    for language, text in TEXTS["languages"]:
        assert lexicon.detect_language(text_normalisation.split_written_words(text)) == language
    assert lexicon.detect_language(("mandrusa", "kolpeti", "vastrini")) == ""


@pytest.mark.long
def test_of_speech() -> None:
    english, spanish = ([tuple(word.split()) for word in words] for words in (ENGLISH, SPANISH))
    assert lexicon.is_english(2 * english) is True
    assert lexicon.is_english(2 * spanish) is False
    assert lexicon.is_english(2 * english + 3 * spanish) is None
    assert lexicon.is_english(english) is None  # too few


def test_words_are_as_they_are_written_in_every_script() -> None:
    for text, words in TEXTS["written_words"]:
        assert " ".join(text_normalisation.split_written_words(text)) == words
