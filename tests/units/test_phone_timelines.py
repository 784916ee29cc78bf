import json
from pathlib import Path

import pytest

from lipmotion.types import Span, Timeline, Unit
from lipmotion.units import Lexicon, group_words, phone_timelines
from lipmotion.units.stress import NUCLEI, find_stress, find_stressed_vowel

TEXTS = json.loads(Path(__file__).with_name("said_texts.json").read_text("utf-8"))


def said(*words: tuple[str, str]) -> Timeline[Unit]:
    """Return words in time, each given as its spelling and its phones; a phone is a second long."""
    phones = [Unit(phone, word=word) for word, text in words for phone in text.split()]
    return Timeline(tuple(Span(float(n), n + 1.0, unit) for n, unit in enumerate(phones)))


def grouped(*words: tuple[str, str]) -> list[tuple[float, float, str]]:
    return [(span.start_s, span.end_s, span.label) for span in group_words(said(*words))]


def test_a_word_that_is_said_again_is_another_one() -> None:
    for word, phones, starts in TEXTS["said_again"]:
        ends = [*starts[1:], len(phones.split())]
        assert grouped((word, phones)) == list(zip(starts, ends, [word] * len(starts), strict=True))


def test_a_word_is_said_as_few_times_as_can_be(monkeypatch: pytest.MonkeyPatch) -> None:
    both = Lexicon({"dodo": (("d", "ow"), ("d", "ow", "d", "ow"))})
    monkeypatch.setattr(phone_timelines, "Lexicon", lambda: both)
    assert grouped(("dodo", "d ow d ow")) == [(0, 4, "dodo")]
    assert grouped(("dodo", "d ow d ow d ow")) in ([(0, 2, "dodo"), (2, 6, "dodo")], [(0, 4, "dodo"), (4, 6, "dodo")])


def test_other_words_and_silence_are_apart() -> None:
    words = grouped(("", "sil"), ("big", "b ih g"), ("", "sp"), ("big", "b ih g"), ("boat", "b ow t"))
    assert words == [(0, 1, ""), (1, 4, "big"), (4, 5, ""), (5, 8, "big"), (8, 11, "boat")]


def test_words_of_the_dictionary() -> None:
    for word, stressed in TEXTS["stressed_vowels"]:
        phones = Lexicon().pronunciations(word)[0]
        assert find_stressed_vowel(word, [phone for phone in phones if phone in NUCLEI]) == stressed


def test_a_consonant_has_the_stress_of_its_syllable() -> None:
    """A syllable begins with one consonant, or with a glide and its lead."""
    for word, phones, stress in TEXTS["stress"]:
        assert find_stress(said((word, phones))) == tuple(stress)
    assert find_stress(said(("bye", "b ay"), ("", "sp"), ("bye", "b ay"))) == (1, 1, None, 1, 1)


def test_silence_and_what_has_no_word() -> None:
    units = said(("", "sil"), ("please", "p l iy z"), ("", "sp b ax ih"), ("hm", "hh m"), ("", "sil"))
    assert find_stress(units) == (None, 1, 1, 1, 1, None, None, 0, None, None, None, None)
    assert find_stress(Timeline(())) == ()


def test_a_word_of_two_equal_halves_is_one() -> None:
    lexicon = Lexicon({"dodo": (("d", "ow", "d", "ow"),)})
    assert find_stress(said(("dodo", "d ow d ow")), lexicon) == (1, 1, 0, 0)
    assert find_stress(said(("dodo", "d ow d ow d ow d ow")), lexicon) == (1, 1, 0, 0, 1, 1, 0, 0)
