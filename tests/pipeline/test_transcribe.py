from __future__ import annotations

import re

import pytest

from lipmotion.errors import AlignmentError, InputError
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.transcribe import MOST_WARNINGS, transcribe, warn_of_guesses
from lipmotion.speech.mfcc import mfcc
from lipmotion.speech.recogniser import Recogniser
from lipmotion.testing.toy import ToySentence
from lipmotion.types import Audio, Features
from lipmotion.units import Lexicon


@pytest.fixture
def features(toy_sentence: ToySentence) -> Features:
    return mfcc(toy_sentence.audio)


@pytest.fixture
def audio(toy_sentence: ToySentence) -> Audio:
    return toy_sentence.audio


@pytest.fixture
def phones(toy_model: Model) -> Recogniser:
    return Recogniser(toy_model.phones, "own")


def test_known_words_are_aligned(
    phones: Recogniser, audio: Audio, toy_sentence: ToySentence, features: Features
) -> None:
    units = transcribe(phones, audio, features, toy_sentence.words, Lexicon())
    assert [span.label for span in units] == [span.label for span in toy_sentence.units]


def test_unknown_words_are_recognised(
    phones: Recogniser, audio: Audio, toy_sentence: ToySentence, features: Features
) -> None:
    units = transcribe(phones, audio, features, None, Lexicon())
    assert [span.label.phone for span in units] == [span.label.phone for span in toy_sentence.units]
    assert not any(span.label.word for span in units)


def test_what_is_not_in_the_dictionary_is_reported_once(
    phones: Recogniser, audio: Audio, features: Features, caplog: pytest.LogCaptureFixture
) -> None:
    transcribe(phones, audio, features, ("see", "bimab", "papa", "bimab"), Lexicon())
    (record,) = caplog.records
    assert (record.name, record.levelname) == ("lipmotion", "WARNING")
    assert record.getMessage() == (
        "'bimab' is not in the dictionary; read as 'b ih m ae b'; a lexicon file can say better"
    )


def test_what_the_user_s_lexicon_knows_is_not_reported(
    phones: Recogniser, audio: Audio, features: Features, caplog: pytest.LogCaptureFixture
) -> None:
    lexicon = Lexicon({"bimab": (("b", "aa", "b"),)})
    units = transcribe(phones, audio, features, ("see", "bimab", "papa", "mama"), lexicon)
    assert [span.label.phone for span in units if span.label.word == "bimab"] == ["b", "aa", "b"]
    assert not caplog.records


def test_nothing_is_reported_when_nothing_is_guessed(caplog: pytest.LogCaptureFixture) -> None:
    warn_of_guesses(("see", "bob's", "hello"), Lexicon())
    assert not caplog.records


WRONG = ("squash", "six", "fish", "chefs")


def test_a_transcript_of_something_else_is_doubted(
    toy_model: Model, audio: Audio, features: Features, caplog: pytest.LogCaptureFixture
) -> None:
    transcribe(Recogniser(toy_model.phones, "auto"), audio, features, WRONG, Lexicon())
    (record,) = caplog.records
    assert (record.name, record.levelname) == ("lipmotion", "WARNING")
    message = r"the transcript seems not to be what is said \(.* at -\d+\.\d, required -4\.2 or more\); check it, or .*"
    assert re.fullmatch(message, record.getMessage())


def test_the_right_one_is_not(
    toy_model: Model, toy_sentence: ToySentence, audio: Audio, features: Features, caplog: pytest.LogCaptureFixture
) -> None:
    for words in (toy_sentence.words, None):
        transcribe(Recogniser(toy_model.phones, "auto"), audio, features, words, Lexicon())
    assert not caplog.records


def test_without_general_models_nothing_is_doubted(
    phones: Recogniser, audio: Audio, features: Features, caplog: pytest.LogCaptureFixture
) -> None:
    transcribe(phones, audio, features, WRONG, Lexicon())
    assert not caplog.records


def test_a_long_word_is_not_repeated_in_full(caplog: pytest.LogCaptureFixture) -> None:
    warn_of_guesses(("ab" * 5000,), Lexicon())
    (record,) = caplog.records
    assert len(record.getMessage()) < 300


def test_it_says_what_is_wrong(phones: Recogniser, audio: Audio, features: Features) -> None:
    with pytest.raises(InputError, match="how 'näh' is said"):
        transcribe(phones, audio, features, ("näh",), Lexicon())
    with pytest.raises(AlignmentError, match="too short"):
        transcribe(phones, audio, features, ("five",) * 60, Lexicon())


def test_of_many_guesses_some_are_reported_one_by_one(caplog: pytest.LogCaptureFixture) -> None:
    warn_of_guesses([f"bimab{'ab' * i}" for i in range(MOST_WARNINGS + 7)], Lexicon())
    *each, last = [record.getMessage() for record in caplog.records]
    assert len(each) == MOST_WARNINGS
    assert last == "7 more words are not in the dictionary; a lexicon file can say better"


def test_words_beyond_the_recording_are_refused(phones: Recogniser, audio: Audio, features: Features) -> None:
    with pytest.raises(AlignmentError, match="nobody says so much"):
        transcribe(phones, audio, features, ("five",) * 5000, Lexicon())
