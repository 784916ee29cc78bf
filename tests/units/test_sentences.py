import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.errors import InputError
from lipmotion.units import find_words
from lipmotion.units.text_normalisation import (
    LONGEST_SENTENCE,
    LONGEST_WORD,
    MAX_CHARACTERS,
    clean_text,
    split_sentences,
)


def test_sentences() -> None:
    for text, sentences in (
        ("One. Two! Three? Four", ["One.", "Two!", "Three?", "Four"]),
        ("Dr. Smith, e.g. J. Smith, came at 3 p.m. today.", ["Dr. Smith, e.g. J. Smith, came at 3 p.m. today."]),
        ("It was I. Then he left.", ["It was I.", "Then he left."]),
        ('He said "stop." Then (he) left.', ['He said "stop."', "Then (he) left."]),
        ("3.5 per cent of a.b", ["3.5 per cent of a.b"]),
        ("A title\n\nA text\nthat goes on", ["A title.", "A text that goes on"]),
        ("One. ... !? Two.", ["One.", "Two."]),
        ("你好。再见。", ["你好。", "再见。"]),
        ("Wait... what?", ["Wait...", "what?"]),
        ("a\x00b\x1b[31m c\ud800d\u2028e", ["a b [31m c d e"]),
    ):
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
@given(st.text(max_size=300))
def test_no_word_is_lost_or_made(text: str) -> None:
    words = find_words(clean_text(text))
    if words:
        parts = split_sentences(text)
        assert tuple(word for part in parts for word in find_words(part)) == words
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
