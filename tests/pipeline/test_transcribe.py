from __future__ import annotations

import pytest

from lipmotion.errors import AlignmentError, InputError
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.toy import ToySentence
from lipmotion.pipeline.transcribe import report_guesses, transcribe
from lipmotion.speech.mfcc import mfcc
from lipmotion.types import Features
from lipmotion.units import Lexicon


@pytest.fixture
def features(toy_sentence: ToySentence) -> Features:
    return mfcc(toy_sentence.audio)


def test_known_words_are_aligned(toy_model: Model, toy_sentence: ToySentence, features: Features) -> None:
    units = transcribe(toy_model.phones, features, toy_sentence.words, Lexicon())
    assert [span.label for span in units] == [span.label for span in toy_sentence.units]


def test_unknown_words_are_recognised(toy_model: Model, toy_sentence: ToySentence, features: Features) -> None:
    units = transcribe(toy_model.phones, features, None, Lexicon())
    assert [span.label.phone for span in units] == [span.label.phone for span in toy_sentence.units]
    assert not any(span.label.word for span in units)


def test_what_is_not_in_the_dictionary_is_reported_once(
    toy_model: Model, features: Features, caplog: pytest.LogCaptureFixture
) -> None:
    transcribe(toy_model.phones, features, ("see", "bimab", "papa", "bimab"), Lexicon())
    (record,) = caplog.records
    assert (record.name, record.levelname) == ("lipmotion", "WARNING")
    assert record.getMessage() == (
        "'bimab' is not in the dictionary; read as 'b ih m ae b'; a lexicon file can say better"
    )


def test_what_the_user_s_lexicon_knows_is_not_reported(
    toy_model: Model, features: Features, caplog: pytest.LogCaptureFixture
) -> None:
    lexicon = Lexicon({"bimab": (("b", "aa", "b"),)})
    units = transcribe(toy_model.phones, features, ("see", "bimab", "papa", "mama"), lexicon)
    assert [span.label.phone for span in units if span.label.word == "bimab"] == ["b", "aa", "b"]
    assert not caplog.records


def test_nothing_is_reported_when_nothing_is_guessed(caplog: pytest.LogCaptureFixture) -> None:
    report_guesses(("see", "bob's", "hello"), Lexicon())
    assert not caplog.records


def test_it_says_what_is_wrong(toy_model: Model, features: Features) -> None:
    with pytest.raises(InputError, match="how 'näh' is said"):
        transcribe(toy_model.phones, features, ("näh",), Lexicon())
    with pytest.raises(AlignmentError, match="too short"):
        transcribe(toy_model.phones, features, ("five",) * 60, Lexicon())
