"""The language of a request: whose words, whose pronunciations, and how sure the phones are."""

from pathlib import Path

import numpy as np
import pytest

import lipmotion
from lipmotion import Request
from lipmotion.errors import InputError
from lipmotion.pipeline.analysis import language
from lipmotion.pipeline.analysis.language import detect_english, resolve_language, warn_of_another_language
from lipmotion.pipeline.analysis.read_request import read_request
from lipmotion.pipeline.generation import MAPPED_CONFIDENCE
from lipmotion.pipeline.request import as_request
from lipmotion.speech.recognition.recognised_speech import RecognisedWord, Recognition
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.voices.espeak import LanguageLexicon
from lipmotion.types import Audio, Span, TimedTranscript, TimedWord, Timeline, TranscriptLine
from lipmotion.units import Lexicon

EXAMPLES = Path(__file__).parents[2] / "examples"
SILENCE = Audio(np.zeros(16_000, np.float32), 16_000)
USER = Lexicon({"papa": (("p", "aa", "p", "aa"),), "2": (("m", "aa"),)})


def test_english_stays_as_it_is():
    request = Request(SILENCE, "two papas")
    assert resolve_language(request) is request


def test_another_language_has_its_own_words_and_lexicon(tmp_path):
    (tmp_path / "words.txt").write_text("¡Papa, 2!", encoding="utf-8")
    for transcript in ("¡Papa, 2!", tmp_path / "words.txt"):
        request = resolve_language(
            read_request(Request(SILENCE, transcript, lexicon=USER, language="es"), is_typed=False)
        )
        assert isinstance(request.transcript, TimedTranscript)
        assert request.transcript.words == ("papa", "2")
        assert isinstance(request.lexicon, LanguageLexicon)
        assert request.lexicon.pronunciations("2") == (("m", "aa"),)


def test_written_forms_in_subtitles_are_not_read_as_english():
    written = tuple(map(TimedWord, ("perro", "$20M", "&", "St.", "21")))
    user = Lexicon(dict.fromkeys(("perro", "20m", "st", "21"), (("m", "aa"),)))
    request = resolve_language(
        Request(SILENCE, TimedTranscript((TranscriptLine(written),)), lexicon=user, language="es")
    )
    assert isinstance(request.transcript, TimedTranscript)
    assert request.transcript.words == ("perro", "20m", "st", "21")
    assert request.lexicon.spoken_forms("21") == ((("m", "21"), ("aa", "21")),)


def test_unknown_languages_are_refused():
    with pytest.raises(InputError, match="language is 'xx', required one of: en, es, fr, "):
        as_request(SILENCE, language="xx")
    with pytest.raises(InputError, match="the language of the transcript is not known; give it, one of: en, es"):
        resolve_language(Request(SILENCE, "mandrusa kolpeti vastrini", language="auto"))


def test_auto_says_what_it_takes_the_speech_for(monkeypatch, caplog):
    assert resolve_language(Request(SILENCE, "bin blue at f two now", language="auto")).language == "en"
    for english, expected in ((True, "en"), (False, "auto"), (None, "en")):
        monkeypatch.setattr(language, "detect_english", lambda _, english=english: english)
        assert resolve_language(Request(SILENCE, language="auto")).language == expected
    said = [record.getMessage().partition(";")[0] for record in caplog.records]
    assert said == [
        "the transcript is taken for English",
        "the speech is taken for English",
        "the speech is not English, in which language it is is not known",
        "the language of the speech is not known, English is assumed",
    ]


def test_mapped_phones_are_not_called_sure(toy_model, toy_sentence):
    words = " ".join(toy_sentence.words)
    lexicon = Lexicon({word: Lexicon().pronunciations(word) for word in toy_sentence.words})
    request = Request(toy_sentence.audio, words, lexicon=lexicon, recogniser="own", language="es")
    outlook = lipmotion.animate(request, model=toy_model).outlook
    assert (outlook.words, outlook.confidence) == ("mapped transcript", MAPPED_CONFIDENCE)
    assert "mapped to English phones, confidence 0.80" in outlook.text
    foreign = " ".join(["sisa mapama bisi", *toy_sentence.words[:1]])
    outlook = lipmotion.animate(Request(toy_sentence.audio, foreign, recogniser="own"), model=toy_model).outlook
    assert outlook.words == "mapped transcript"
    assert outlook.confidence == pytest.approx(0.25)


def test_the_option_reaches_the_request():
    assert read_request(Request("a.wav", language="ko")).language == "ko"
    assert as_request(Request(SILENCE, language="ko"), language="fr").language == "fr"
    assert as_request(Request(SILENCE, language="ko")).language == "ko"


def test_nothing_is_said_without_the_network_or_speech(monkeypatch):
    assert detect_english(SILENCE) is None
    monkeypatch.setattr(language, "installed_phone_recogniser", lambda: None)
    assert detect_english(SILENCE) is None


@pytest.mark.long
def test_the_words_of_english_are_known():
    pytest.importorskip("hama.asr")
    welcome = read_audio(EXAMPLES / "welcome.flac").samples
    assert detect_english(Audio(np.tile(welcome, 4), 16_000)) is True
    assert detect_english(Audio(np.tile(welcome[::-1], 4), 16_000)) is not True


@pytest.mark.parametrize(("confidence", "lasts_s", "warns"), [(0.2, 2.0, True), (0.85, 2.0, False), (0.2, 0.5, False)])
def test_words_that_are_hardly_understood_are_told(confidence, lasts_s, warns, caplog):
    words = Timeline((Span(0.0, lasts_s, RecognisedWord("hola", confidence)),))
    warn_of_another_language(Recognition(Timeline(()), words, lasts_s, 0.0, None))
    assert ("--language" in caplog.text) == warns
    assert (f"confidence {confidence:.2f}" in caplog.text) == warns
