import json
from pathlib import Path

import pytest

from lipmotion import load_model
from lipmotion.units import Lexicon, find_words, group_words, split_words, text_normalisation, written_forms
from pipeline.made import recogniser_of
from testing.formant_synthesiser import synthesise

TEXTS: dict[str, list[tuple[str, str]]] = json.loads(Path(__file__).with_name("said_texts.json").read_text("utf-8"))
USUAL, ALSO = TEXTS["usual"], TEXTS["also"]
"""What is said of a text where nothing else is known; and what else is said of a form."""


@pytest.mark.parametrize(("text", "words"), USUAL)
def test_the_usual_reading(text: str, words: str) -> None:
    assert " ".join(find_words(text)) == words


def test_a_form_has_few_readings_and_a_word_has_one() -> None:
    assert [*map(written_forms.list_readings, ("boat", "5 µs"))] == [(("boat",),), (("five", "microseconds"),)]
    for text, _ in USUAL:
        for token in text_normalisation.tokenise(text):
            found = written_forms.list_readings(token)
            assert 1 <= len(found) == len(set(found)) <= written_forms.MAX_READINGS
            assert all(word == word.lower() and not any(map(str.isdecimal, word)) for said in found for word in said)


@pytest.mark.parametrize(("text", "said"), ALSO)
def test_what_else_may_be_said_is_a_reading(text: str, said: str) -> None:
    (token,) = text_normalisation.tokenise(text)
    forms = Lexicon().spoken_forms(token)
    phones = [phone for word in said.split() for phone in Lexicon().pronunciations(word)[0]]
    assert phones in [[phone for phone, word in form if word] for form in forms]
    assert {word for form in forms for _, word in form if word} >= set(said.split())
    assert Lexicon().known(token)


@pytest.mark.long
def test_the_sound_chooses_the_reading() -> None:
    lexicon, recogniser = Lexicon(), recogniser_of(load_model(), "general")
    wrong = []
    for text, said in ALSO:
        words = ("mother", "saw", *split_words(said), "to", "baby")
        phones = [phone for word in words for phone in lexicon.pronunciations(word)[0]]
        audio, _ = synthesise(
            [("sil", 0.2), *((phone, 0.09) for phone in phones), ("sil", 0.2)], rate_hz=16_000, seed=1
        )
        given = ("mother", "saw", *text_normalisation.tokenise(text), "to", "baby")
        units = recogniser.align(audio, given, lexicon)
        found = tuple(span.label for span in group_words(units) if span.label)
        wrong += [(text, found)] if found != words else []
    assert not wrong


def test_a_user_s_word_goes_before_readings() -> None:
    own = Lexicon({"xkcd": (("z", "iy"),), "noooo": (("n", "ow", "w"),), "1995": (("b", "iy"),)})
    assert own.pronunciations("XKCD") == (("z", "iy"),)
    assert own.pronunciations("noooo") == (("n", "ow", "w"),)
    assert own.pronunciations("1995") == (("b", "iy"),)
