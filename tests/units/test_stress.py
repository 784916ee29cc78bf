from lipmotion.types import Span, Timeline, Unit
from lipmotion.units import Lexicon
from lipmotion.units.stress import NUCLEI, find_stress, find_stressed_vowel


def said(*words: tuple[str, str]) -> Timeline[Unit]:
    """Return words in time, each given as its spelling and its phones."""
    labels = [Unit(phone, word=word) for word, phones in words for phone in phones.split()]
    return Timeline(tuple(Span(n / 10, (n + 1) / 10, label) for n, label in enumerate(labels)))


def test_words_of_the_dictionary() -> None:
    for word, stressed in (
        ("mother", 0), ("again", 1), ("banana", 1), ("before", 1), ("because", 1), ("beautiful", 0), ("nation", 0),
        ("information", 2), ("electric", 1), ("university", 2), ("yesterday", 0), ("japanese", 2), ("animated", 0),
        ("table", 0), ("bread", 0), ("the", None), ("them", None), ("your", None), ("media's", 0),
    ):  # fmt: skip
        phones = Lexicon().pronunciations(word)[0]
        assert find_stressed_vowel(word, [phone for phone in phones if phone in NUCLEI]) == stressed


def test_a_consonant_has_the_stress_of_its_syllable() -> None:
    """A syllable begins with one consonant, or with a glide and its lead."""
    for word, phones, stress in (
        ("information", "ih n f axr m ey sh ax n", (0, 0, 0, 0, 1, 1, 0, 0, 0)),
        ("apply", "ax p l ay", (0, 1, 1, 1)),
        ("handy", "hh ae n d iy", (1, 1, 1, 0, 0)),
        ("singer", "s ih ng axr", (1, 1, 1, 0)),
        ("psst", "p s t", (None, None, None)),
        ("bye", "b ay b ay", (1, 1, 1, 1)),  # said twice
        ("again", "ax g eh n ax g eh n", (0, 1, 1, 1, 0, 1, 1, 1)),
    ):
        assert find_stress(said((word, phones))) == stress
    assert find_stress(said(("bye", "b ay"), ("", "sp"), ("bye", "b ay"))) == (1, 1, None, 1, 1)


def test_silence_and_what_has_no_word_and_a_word_of_two_equal_halves() -> None:
    units = said(("", "sil"), ("please", "p l iy z"), ("", "sp b ax ih"), ("hm", "hh m"), ("", "sil"))
    assert find_stress(units) == (None, 1, 1, 1, 1, None, None, 0, None, None, None, None)
    assert find_stress(Timeline(())) == ()
    lexicon = Lexicon({"dodo": (("d", "ow", "d", "ow"),)})
    assert find_stress(said(("dodo", "d ow d ow")), lexicon) == (1, 1, 0, 0)
    assert find_stress(said(("dodo", "d ow d ow d ow d ow")), lexicon) == (1, 1, 0, 0, 1, 1, 0, 0)
