"""Requests to analysed speech: what they name, their language, their words, and what engines are given."""

from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from lipmotion import Model, Request, animate, load_model
from lipmotion.engines import Engine, Inputs
from lipmotion.errors import InputError
from lipmotion.pipeline.analysis import language
from lipmotion.pipeline.analysis.read_request import read_request, read_text_or_file
from lipmotion.pipeline.analysis.speech_analysis import analyse, analyse_speech, build_speech, recognise_speech
from lipmotion.pipeline.generation import (
    LESS_NOISE,
    MAPPED_CONFIDENCE,
    OWN_MODEL,
    TRANSCRIPT,
    WHOLE_TRANSCRIPT,
    predict_outlook,
)
from lipmotion.pipeline.request import as_request
from lipmotion.speech.features.f0 import log_f0
from lipmotion.speech.recognition.agreement import TranscriptFit
from lipmotion.speech.recognition.recognised_speech import RecognisedWord, Recognition
from lipmotion.types import Audio, Span, Speech, TimedTranscript, TimedWord, Timeline, TranscriptLine, Unit
from lipmotion.units import Lexicon
from pipeline.made import WELCOME, features_of, read_welcome, recogniser_of
from testing.toy import ToySentence


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.usefixtures("here")
def test_a_text_is_itself():
    texts = ["hello there", "see p. 3", "", "α" * 3000, "a/b/c", "the file words.txt", "..", "\n"]
    for text in (*texts, "é" * 130, "é" * 130 + ".abc", "你好.世界", "a" * 300 + ".txt"):
        assert read_text_or_file(text) == text


def test_a_file_is_its_content(here):
    (here / "words").write_text("näh\n", encoding="utf-8-sig")
    assert read_text_or_file("words") == "näh\n"


def test_subtitles_keep_their_times(here):
    (here / "words.srt").write_text("1\n00:00:01,000 --> 00:00:02,500\n<i>Hello</i> there\n")
    transcript = read_text_or_file("words.srt")
    assert isinstance(transcript, TimedTranscript)
    assert transcript.words == ("hello", "there")
    assert (transcript.lines[0].start_s, transcript.lines[0].end_s) == pytest.approx((1.0, 2.5))


def test_a_name_in_a_folder_that_exists_is_no_text(here):
    (here / "subs").mkdir()
    for name in ("subs/nofile", "./nofile", "../nofile", "subs/../nofile", "nofile.txt"):
        with pytest.raises(InputError, match=r"nofile(\.txt)?: no such transcript file"):
            read_text_or_file(name)
    assert read_text_or_file("either/or") == "either/or"
    assert read_text_or_file("subs/ nofile") == "subs/ nofile"
    assert read_text_or_file("x" * 5000 + "/a") == "x" * 5000 + "/a"


SILENCE = Audio(np.zeros(16_000, np.float32), 16_000)
USER = Lexicon({"papa": (("p", "aa", "p", "aa"),), "2": (("m", "aa"),)})


def test_another_language_has_its_own_words_and_lexicon(tmp_path):
    (tmp_path / "words.txt").write_text("¡Papa, 2!", encoding="utf-8")
    for transcript in ("¡Papa, 2!", tmp_path / "words.txt"):
        spanish = Request(SILENCE, transcript, lexicon=USER, language="es")
        request = language.resolve_language(read_request(spanish, is_typed=False))
        assert request.transcript.words == ("papa", "2")
        assert request.lexicon.pronunciations("2") == (("m", "aa"),)
    written = TranscriptLine(tuple(map(TimedWord, ("perro", "$20M", "&", "St.", "21"))))  # not read as English
    user = Lexicon(dict.fromkeys(("perro", "20m", "st", "21"), (("m", "aa"),)))
    request = language.resolve_language(Request(SILENCE, TimedTranscript((written,)), lexicon=user, language="es"))
    assert request.transcript.words == ("perro", "20m", "st", "21")
    assert request.lexicon.spoken_forms("21") == ((("m", "21"), ("aa", "21")),)


def test_unknown_languages_are_refused():
    with pytest.raises(InputError, match="language is 'xx', required one of: en, es, fr, "):
        as_request(SILENCE, language="xx")
    with pytest.raises(InputError, match="the language of the transcript is not known; give it, one of: en, es"):
        language.resolve_language(Request(SILENCE, "mandrusa kolpeti vastrini", language="auto"))


def test_auto_says_what_it_takes_the_speech_for(caplog):
    for transcript in ("bin blue at f two now", None):
        assert language.resolve_language(Request(SILENCE, transcript, language="auto")).language == "en"
    assert language.detect_english(SILENCE) is None
    first, second = (message.partition(";")[0] for message in caplog.messages)
    assert first == "the transcript is taken for English"
    assert second == "the language of the speech is not known, English is assumed"


def test_mapped_phones_are_not_called_sure(toy_model, toy_sentence):
    words = " ".join(toy_sentence.words)
    lexicon = Lexicon({word: Lexicon().pronunciations(word) for word in toy_sentence.words})
    request = Request(toy_sentence.audio, words, lexicon=lexicon, recogniser="own", language="es")
    outlook = animate(request, model=toy_model).outlook
    assert (outlook.words, outlook.confidence) == ("mapped transcript", MAPPED_CONFIDENCE)
    assert "mapped to English phones, confidence 0.80" in outlook.text
    foreign = " ".join(["sisa mapama bisi", *toy_sentence.words[:1]])
    outlook = animate(Request(toy_sentence.audio, foreign, recogniser="own"), model=toy_model).outlook
    assert (outlook.words, outlook.confidence) == ("mapped transcript", pytest.approx(0.25))


@pytest.mark.long
def test_the_words_of_english_are_known(caplog):
    pytest.importorskip("hama.asr")
    welcome = read_welcome().samples
    for samples, taken in ((welcome, "taken for English"), (welcome[::-1], "not")):
        language.resolve_language(Request(Audio(np.tile(samples, 4), 16_000), language="auto"))
        assert taken in caplog.messages[-1]


@pytest.mark.parametrize(("confidence", "lasts_s", "warns"), [(0.2, 2.0, True), (0.85, 2.0, False), (0.2, 0.5, False)])
def test_words_that_are_hardly_understood_are_told(confidence, lasts_s, warns, caplog):
    words = Timeline((Span(0.0, lasts_s, RecognisedWord("hola", confidence)),))
    language.warn_of_another_language(Recognition(Timeline(()), words, lasts_s, 0.0, None))
    assert ("--language" in caplog.text) == warns
    assert (f"confidence {confidence:.2f}" in caplog.text) == warns


@pytest.mark.long
def test_speech_is_as_reliable_as_its_words():
    model, understood = load_model(), analyse_speech(load_model(), Request(WELCOME))
    assert understood.speech.confidence == pytest.approx(understood.recognition.reliability)
    assert understood.speech.units == analyse(model, Request(WELCOME)).units
    assert analyse_speech(model, Request(WELCOME, transcript="please speak")).recognition is None
    assert analyse(model, Request(WELCOME, recogniser="fast")).confidence == pytest.approx(0)


@dataclass(frozen=True)
class RecognisingEngine(Engine[Any]):
    """Recognises the phones that it is given."""

    config: Any = None
    found: Timeline[Unit] | None = None
    f0: bool = True
    name: ClassVar[str] = "recognising"

    def inputs(self, motion_s: float = np.inf) -> Inputs:  # noqa: ARG002
        return Inputs(f0=self.f0)

    def recognise(self, model: object, speech: Speech) -> Timeline[Unit] | None:  # noqa: ARG002
        assert len(speech.units) == 0
        return self.found

    def fit(self, examples: object, monitor: object) -> Any: ...
    def generate(self, model: object, speech: object, constraints: object = None) -> Any: ...
    def to_arrays(self, model: object) -> Any: ...
    def from_arrays(self, arrays: object) -> Any: ...


RECOGNISED: Timeline[Unit] = Timeline((Span(0.0, 1.0, Unit("sil")), Span(1.0, 2.0, Unit("aa"))))
RECOGNITION = Recognition(RECOGNISED, Timeline(()), 0.0, 0.0, None)


def recognised(engine: Engine[Any], model: Model, sentence: ToySentence, kind: str = "own") -> Speech:
    phones, features = recogniser_of(model, kind), features_of(sentence.audio)
    return recognise_speech(engine, None, sentence.audio, features, phones, lambda: RECOGNITION)


def test_phones_that_the_engine_recognises_are_aligned_as_in_training(toy_model, toy_sentence):
    """Its phones, with the times of forced alignment, and no words."""
    late = toy_sentence.units.shifted(0.07)
    speech = recognised(RecognisingEngine(found=late), toy_model, toy_sentence)
    assert [s.label.phone for s in speech.units] == [s.label.phone for s in toy_sentence.units]
    assert {s.label.word for s in speech.units} == {""}
    assert {s.label.confidence for s in speech.units} == {0.0}
    errors = [abs(a.start_s - b.start_s) for a, b in zip(speech.units, toy_sentence.units, strict=True)]
    assert np.median(errors) < 0.03


def test_the_recogniser_says_what_the_engine_does_not_know(toy_model, toy_sentence, monkeypatch):
    """Or what general models alone are asked for, what does not fit the sound, or a voice unknown to the model."""
    crowd = [span for n in range(30) for span in Timeline(toy_sentence.units.spans[1:-1]).shifted(3.0 * n)]
    for found, kind in ((None, "own"), (toy_sentence.units, "general"), (Timeline(tuple(crowd)), "own")):
        speech = recognised(RecognisingEngine(found=found), toy_model, toy_sentence, kind)
        assert speech.units[1].label.phone == "aa"
    monkeypatch.setattr("lipmotion.pipeline.analysis.speech_analysis.rate_knowledge", lambda *_: 0.0)
    assert recognised(RecognisingEngine(found=toy_sentence.units), toy_model, toy_sentence).units[1].label.phone == "aa"


def test_a_voice_whose_words_are_given_is_known_where_the_engine_recognises_it(toy_sentence, monkeypatch):
    monkeypatch.setattr("lipmotion.pipeline.analysis.speech_analysis.rate_knowledge", lambda *_: 0.4)
    request = Request(WELCOME, transcript=WELCOME.with_suffix(".txt"), recogniser="fast")
    for found, voice in ((None, 0.4), (toy_sentence.units, 1.0)):
        speech = analyse_speech(replace(load_model(), engine=RecognisingEngine(found=found)), request).speech
        assert {part.speech.voice for part in speech.parts} == {voice}


def test_f0_is_computed_for_engines_that_want_it(toy_sentence):
    features = features_of(toy_sentence.audio)
    found = build_speech(RecognisingEngine(), toy_sentence.audio, features, toy_sentence.units).log_f0
    np.testing.assert_allclose(found, log_f0(toy_sentence.audio), rtol=1e-5)
    deaf = RecognisingEngine(f0=False)
    assert build_speech(deaf, toy_sentence.audio, features, toy_sentence.units).log_f0 is None


def group_words(sentence: ToySentence, late_s: float = 0.0) -> TimedTranscript:
    lines = []
    for word, spans in groupby(sentence.units, key=lambda span: span.label.word):
        inside = list(spans)
        if word:
            start_s, end_s = inside[0].start_s + late_s, inside[-1].end_s + late_s
            lines.append(TranscriptLine((TimedWord(word),), start_s, end_s))
    return TimedTranscript(tuple(lines))


def test_subtitles_are_aligned_within_their_times(toy_model, toy_sentence, tmp_path):
    text = f"00:00:00,300 --> 00:00:02,600\n<i>{' '.join(toy_sentence.words)}</i>\n"
    (tmp_path / "said.srt").write_text(text, encoding="utf-8")
    plain = Request(toy_sentence.audio, transcript=" ".join(toy_sentence.words), recogniser="own")
    wanted = analyse(toy_model, plain)
    for transcript in (tmp_path / "said.srt", text, group_words(toy_sentence), group_words(toy_sentence, 0.4)):
        found = analyse(toy_model, replace(plain, transcript=transcript))
        assert found.units == wanted.units
        assert found.units_known


def test_times_decide_where_words_alone_do_not(toy_model, toy_sentence):
    """The sentence twice, and a transcript of the second time alone."""
    twice = Audio(np.tile(toy_sentence.audio.samples, 2), 16_000)
    second = group_words(toy_sentence, toy_sentence.audio.duration_s)
    found = analyse(toy_model, Request(twice, transcript=second, recogniser="own")).units
    starts_s = [span.start_s for span in found if span.label.word]
    true_s = [span.start_s + toy_sentence.audio.duration_s for span in toy_sentence.units if span.label.word]
    assert starts_s == pytest.approx(true_s, abs=0.06)


def test_a_transcript_beside_a_request_is_taken_if_there_is_no_other(toy_model, toy_sentence, tmp_path):
    assert as_request(Request("a.wav"), "papa").transcript == "papa"
    assert as_request("a.wav", "papa").transcript == "papa"
    with pytest.raises(InputError, match="give one"):
        as_request(Request("a.wav", "mama"), "papa")
    (tmp_path / "words.txt").write_text("papa", encoding="utf-8")
    with pytest.raises(InputError, match="is the name of a file; give Path"):
        analyse(toy_model, Request(toy_sentence.audio, transcript=str(tmp_path / "words.txt")))


@pytest.mark.parametrize("kind", ["own", "auto"])
def test_a_recording_without_speech(toy_model, kind, caplog):
    request = Request(Audio(np.zeros(16_000, np.float32), 16_000), recogniser=kind)
    understood = analyse_speech(toy_model, request)
    (text,) = caplog.messages
    assert text.startswith("no speech found in the recording: the mouth rests; give a recording in which something")
    assert understood.is_without_speech
    outlook = predict_outlook(request, understood)
    assert (outlook.words, outlook.advice, outlook.text) == ("no speech", (), "no speech found; levels 0 dB apart")


def test_a_transcript_beside_units_is_not_used(toy_model, toy_sentence, caplog):
    request = Request(toy_sentence.audio, transcript="hello", units=toy_sentence.units)
    assert analyse(toy_model, request).units == toy_sentence.units
    (message,) = caplog.messages
    assert message == "the transcript is not used: the units already say what is spoken; leave one of them out"


@pytest.mark.parametrize(
    ("confidence", "word_s", "range_db", "advice"),
    [
        (0.6, 3.0, 30.0, (TRANSCRIPT, OWN_MODEL)),  # clear English of a stranger
        (0.18, 3.0, 15.0, (TRANSCRIPT, LESS_NOISE, OWN_MODEL)),  # another language, or words in noise
        (0.9, 1.0, 30.0, (TRANSCRIPT, OWN_MODEL)),  # sure words, which are few
        (0.9, 3.0, 30.0, (OWN_MODEL,)),
    ],
)
def test_unsure_words_are_asked_for_first(toy_model, toy_sentence, confidence, word_s, range_db, advice):
    request = Request(toy_sentence.audio, transcript=" ".join(toy_sentence.words))
    words = Timeline((Span(0.0, 1.0, RecognisedWord("papa", confidence)),))
    recognition = Recognition(RECOGNISED, words, word_s, 3.0 - word_s, -60.0)
    understood = replace(analyse_speech(toy_model, request), recognition=recognition, fit=None)
    understood = replace(understood, speech=replace(understood.speech, range_db=range_db))
    outlook = predict_outlook(request, understood)
    assert outlook.advice == advice
    assert outlook.text.endswith(f"would help most: {advice[0]}")


def test_the_outlook_says_how_much_of_the_speech_a_transcript_fits(toy_model, toy_sentence):
    request = Request(toy_sentence.audio, transcript=" ".join(toy_sentence.words))
    understood = analyse_speech(toy_model, request)
    understood = replace(understood, speech=replace(understood.speech, range_db=30.0))
    assert understood.fit is not None
    whole = predict_outlook(request, understood)
    assert (whole.confidence, whole.text) == (pytest.approx(1), "words: transcript; levels 30 dB apart")
    part = predict_outlook(request, replace(understood, fit=TranscriptFit(-2.0, ((0.0, 3.0),), 4.0)))
    assert (part.confidence, part.advice) == (pytest.approx(0.25), (WHOLE_TRANSCRIPT,))
    assert part.text.startswith("words: transcript, which fits 25% of the speech; levels 30 dB apart; would help most")
    wrong = predict_outlook(request, replace(understood, fit=TranscriptFit(-7.0, (), 4.0)))
    assert (wrong.words, wrong.confidence) == ("transcript", pytest.approx(0))  # used all the same
