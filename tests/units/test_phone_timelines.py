import pytest

from lipmotion.types import Span, Timeline, Unit
from lipmotion.units import Lexicon, group_words, phone_timelines


def said(*words: tuple[str, str]) -> list[tuple[float, float, str]]:
    """Return the words in time of words with their phones, each phone a second long."""
    phones = [Unit(phone, word=word) for word, text in words for phone in text.split()]
    units = Timeline(tuple(Span(float(n), n + 1.0, unit) for n, unit in enumerate(phones)))
    return [(span.start_s, span.end_s, span.label) for span in group_words(units)]


def test_a_word_that_is_said_again_is_another_one() -> None:
    for word, phones, starts in (
        ("big", "b ih g b ih g", [0, 3]), ("Big", "b ih g b ih g b ih g", [0, 3, 6]), ("the", "dh ax dh iy", [0, 2]),
        ("tutu", "t uw t uw", [0]), ("tutu", "t uw t uw t uw t uw", [0, 4]), ("mama", "m aa m ax", [0]),
        ("bigbig", "b ih g b ih g", [0]), ("big", "b ih b ih", [0, 2]), ("zero", "z iy r ow z iy r ow", [0, 4]),
        ("blorp", "b l ao r p b l ao r p b l ao r p", [0, 5, 10]),
        ("hahaha", "hh aa hh aa hh aa hh aa hh aa hh aa", [0, 6]), ("brrk", "r r r", [0]), ("", "b ih g b ih g", [0]),
    ):  # fmt: skip
        ends = [*starts[1:], len(phones.split())]
        assert said((word, phones)) == list(zip(starts, ends, [word] * len(starts), strict=True))


def test_a_word_is_said_as_few_times_as_can_be(monkeypatch: pytest.MonkeyPatch) -> None:
    both = Lexicon({"dodo": (("d", "ow"), ("d", "ow", "d", "ow"))})
    monkeypatch.setattr(phone_timelines, "Lexicon", lambda: both)
    assert said(("dodo", "d ow d ow")) == [(0, 4, "dodo")]
    assert said(("dodo", "d ow d ow d ow")) in ([(0, 2, "dodo"), (2, 6, "dodo")], [(0, 4, "dodo"), (4, 6, "dodo")])


def test_other_words_and_silence_are_apart() -> None:
    words = said(("", "sil"), ("big", "b ih g"), ("", "sp"), ("big", "b ih g"), ("boat", "b ow t"))
    assert words == [(0, 1, ""), (1, 4, "big"), (4, 5, ""), (5, 8, "big"), (8, 11, "boat")]
