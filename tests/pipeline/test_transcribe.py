import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lipmotion import Model, load_model
from lipmotion.errors import AlignmentError
from lipmotion.pipeline.analysis import transcribe
from lipmotion.speech.recognition.network.posteriors import find_installed_recogniser
from lipmotion.speech.recognition.recognised_speech import select_reliable
from lipmotion.speech.sound.acoustic_conditions import mix_noise
from lipmotion.speech.sound.analysed_audio import analysed
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio, TimedTranscript, TimedWord, Timeline, TranscriptLine, Unit
from lipmotion.units import Lexicon, is_silent, split_words
from lipmotion.units.phone_timelines import group_words
from lipmotion.units.phones import count_phone_edits
from pipeline.made import WELCOME, read_welcome, recogniser_of
from testing.toy import ToySentence


@pytest.fixture
def audio(toy_sentence: ToySentence) -> Audio:
    return toy_sentence.audio


@pytest.fixture
def phones(toy_model: Model) -> Any:
    return recogniser_of(toy_model)


def test_unknown_words_are_recognised(phones, audio, toy_sentence):
    units, _ = transcribe.transcribe(phones, audio, None, Lexicon())
    assert [span.label.phone for span in units] == [span.label.phone for span in toy_sentence.units]
    assert not any(span.label.word for span in units)


def test_what_is_not_in_the_dictionary_is_reported_once(phones, audio, caplog):
    transcribe.transcribe(phones, audio, ("see", "bimab", "papa", "bimab"), Lexicon())
    (message,) = caplog.messages
    assert "'bimab' is not in the dictionary; read as 'b " in message


WRONG = ("squash", "six", "fish", "chefs")


@pytest.mark.parametrize("network", [True, False])
def test_a_transcript_of_something_else_is_doubted(toy_model, audio, caplog, network):
    if network and find_installed_recogniser() is None:
        pytest.skip("no phone recogniser is installed")
    phones = recogniser_of(toy_model, "auto" if network else "general")
    recognised = lambda: phones.recognise(audio).units  # noqa: E731
    units, _ = transcribe.transcribe(phones, audio, WRONG, Lexicon(), recognised)
    assert (units is None) == network  # what is said is to be recognised
    (record,) = caplog.records
    assert (record.name, record.levelname) == ("lipmotion", "WARNING")
    why = r"0 of its 4 words are heard" if network else r"at -\d+\.\d, required -4\.2 or more"
    message = rf"the transcript seems not to be what is said \(.*{why}\).*check it, or .*"
    assert re.fullmatch(message, record.getMessage())


def test_the_right_one_is_not(toy_model, phones, toy_sentence, audio, caplog):
    for words in (toy_sentence.words, None):
        transcribe.transcribe(recogniser_of(toy_model, "auto"), audio, words, Lexicon())
    transcribe.transcribe(phones, audio, WRONG, Lexicon())  # without general models nothing is doubted
    assert not caplog.records


@pytest.fixture(scope="module")
def welcome() -> tuple[Any, tuple[str, ...]]:
    """Real speech of five seconds, and its words."""
    return read_welcome(), split_words(WELCOME.with_suffix(".txt").read_text())


def corrected(audio: Any, words: tuple[str, ...]) -> transcribe.Transcription:
    """Return what the shipped model makes of words, with what it recognises where they are wrong."""
    phones = recogniser_of(load_model(), "auto")

    def recognised() -> Timeline[Unit]:
        return select_reliable(phones.recognise(audio).units, 0.7)

    return transcribe.transcribe(phones, audio, words, Lexicon(), recognised)


@pytest.mark.parametrize("kept", [slice(0, 7), slice(7, None)])
def test_speech_that_the_transcript_leaves_out_is_reported_with_its_times(welcome, kept, caplog):
    (audio, words), phones = welcome, recogniser_of(load_model(), "auto")
    whole = transcribe.transcribe(phones, audio, words, Lexicon())
    assert whole.fit.missing == ()
    assert whole.fit.share == pytest.approx(1)
    assert not caplog.records
    part = corrected(audio, words[kept])
    assert part.fit.share < 0.8
    (record,) = caplog.records
    assert re.search(r"to leave out words at \d\.\d to \d\.\d s.* \(\d\.\d of \d\.\d s spoken\)", record.getMessage())
    said = {span.label.word: span for span in whole.units}
    assert part.units is not None
    recognised = {span.label.word for span in part.units if span.label.confidence is not None}
    assert recognised & (set(words) - set(words[kept]))  # there
    assert {*words[kept]} <= {span.label.word for span in part.units if span.label.confidence is None}
    left_out = [said[word] for word in set(words) - set(words[kept])]
    for start_s, end_s in part.fit.missing:  # each stretch covers a part of what was left out
        assert any(start_s < span.end_s and span.start_s < end_s for span in left_out)


def test_a_word_that_is_heard_is_not_sought_far_away(welcome):
    """Recognition takes it for something else, and something else, that the transcript lacks, for it."""
    (audio, words), phones = welcome, recogniser_of(load_model(), "auto")
    spans = list(phones.align(audio, words, Lexicon()))
    places = {span.label.word: number for number, span in reversed([*enumerate(spans)])}
    right_s = spans[places["speak"]].start_s
    for word, others in {"speak": ("t", "t", "t", "t"), "boats": ("s", "p", "iy", "k")}.items():
        for number, phone in enumerate(others, places[word]):
            spans[number] = replace(spans[number], label=Unit(phone))
    part = transcribe.transcribe(phones, audio, words[:2], Lexicon(), lambda: Timeline(tuple(spans)))
    assert next(s.start_s for s in part.units if s.label.word == "speak") == pytest.approx(right_s, abs=0.2)


@pytest.mark.parametrize("kept", [slice(None, None, 2), slice(1, None, 2), slice(None, None, 3)])
def test_words_here_and_there_are_no_worse_than_none(welcome, kept):
    """Words beside those that are left out are not stretched over them, however short they are."""
    (audio, words), phones = welcome, recogniser_of(load_model(), "auto")
    right, none = phones.align(audio, words, Lexicon()), phones.recognise(audio).units
    some = corrected(audio, words[kept]).units
    assert some is not None
    wanted, with_some, with_none = (
        [span.label.phone for span in units if not is_silent(span.label.phone)] for units in (right, some, none)
    )
    assert count_phone_edits(wanted, with_some) <= count_phone_edits(wanted, with_none)


@pytest.mark.skipif(find_installed_recogniser() is None, reason="no phone recogniser is installed")
def test_in_noise_words_are_where_they_are_heard(welcome):
    (audio, words), phones = welcome, recogniser_of(load_model(), "auto")
    noisy = analysed(mix_noise(audio, "white", 3, [], 0))
    places_s = [
        [span.start_s for span in group_words(units) if span.label]
        for units, _ in (transcribe.transcribe(phones, a, words, Lexicon()) for a in (audio, noisy))
    ]
    assert np.array(places_s[1]) == pytest.approx(
        np.array(places_s[0]), abs=0.2
    )  # by forced alignment, one is 0.48 off


@pytest.mark.recordings
@pytest.mark.skipif(find_installed_recogniser() is None, reason="no phone recogniser is installed")
def test_fast_speech_keeps_the_words_that_are_recognised(recordings):
    audio = analysed(read_audio(recordings / "speech-open" / "acoustic_corpus.wav"))
    words = split_words((recordings / "speech-open" / "acoustic_corpus.lab").read_text("utf-8"))
    fit = corrected(audio, words).fit
    assert len(fit.unsaid) < len(words) / 4  # of 59; 27 where a few that are not doubt all those beside them


@pytest.mark.parametrize("first", [False, True])
def test_a_sentence_that_nobody_says_is_left_out(welcome, first, caplog):
    (audio, words), phones = welcome, recogniser_of(load_model(), "auto")
    extra = split_words("nobody answered the bell")
    whole = transcribe.transcribe(phones, audio, words, Lexicon()).units
    longer = corrected(audio, (*extra, *words) if first else (*words, *extra))
    assert [span.label for span in longer.units] == [span.label for span in whole]
    assert tuple(word.word for word in longer.fit.unsaid) == extra
    (record,) = caplog.records
    assert "words that are not said: 'nobody' at " in record.getMessage()


def test_speech_outside_of_the_times_of_a_transcript_is_reported(welcome, caplog):
    audio, words = welcome
    first = TranscriptLine(tuple(map(TimedWord, words[:2])), 0.3, 0.9)
    part = transcribe.transcribe(recogniser_of(load_model(), "auto"), audio, TimedTranscript((first,)), Lexicon())
    assert part.fit.share < 0.5
    (record,) = caplog.records
    assert "to leave out words at" in record.getMessage()


def test_a_long_word_is_not_repeated_in_full(caplog):
    transcribe.warn_of_guesses(("ab" * 5000,), Lexicon())
    (message,) = caplog.messages
    assert len(message) < 300


def test_words_beyond_the_recording_are_refused(phones, audio):
    with pytest.raises(AlignmentError, match="nobody says so much"):
        transcribe.transcribe(phones, audio, ("five",) * 5000, Lexicon())
