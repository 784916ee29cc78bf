from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any, ClassVar

import numpy as np
import pytest

from lipmotion import Model, Request
from lipmotion.engines import Engine, Inputs
from lipmotion.errors import InputError
from lipmotion.pipeline.analysis import speech_analysis as pipeline_analysis
from lipmotion.pipeline.analysis.speech_analysis import analyse, analyse_speech, build_speech, recognise_speech
from lipmotion.pipeline.generation import LESS_NOISE, OWN_MODEL, TRANSCRIPT, WHOLE_TRANSCRIPT, predict_outlook
from lipmotion.pipeline.request import as_request
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.features.f0 import log_f0
from lipmotion.speech.recognition.agreement import TranscriptFit
from lipmotion.speech.recognition.recognised_speech import RecognisedWord, Recognition
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.types import Audio, Span, Speech, TimedTranscript, TimedWord, Timeline, TranscriptLine, Unit
from testing.toy import ToySentence


@dataclass(frozen=True)
class RecognisingEngine(Engine[Any]):
    """Recognises the phones that it is given."""

    config: Any = None
    found: Timeline[Unit] | None = None
    name: ClassVar[str] = "recognising"

    def inputs(self, motion_s: float = np.inf) -> Inputs:  # noqa: ARG002
        return Inputs(f0=True)

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
    phones, features = Recogniser(model.phones, kind), analysed(sentence.audio).mfcc()
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


def test_the_recogniser_says_what_the_engine_does_not_know(toy_model, toy_sentence):
    """Or what general models alone are asked for, or what does not fit the sound."""
    crowd = [span for n in range(30) for span in Timeline(toy_sentence.units.spans[1:-1]).shifted(3.0 * n)]
    for found, kind in ((None, "own"), (toy_sentence.units, "general"), (Timeline(tuple(crowd)), "own")):
        speech = recognised(RecognisingEngine(found=found), toy_model, toy_sentence, kind)
        assert speech.units[1].label.phone == "aa"


def test_f0_is_computed_for_engines_that_want_it(toy_sentence):
    features = analysed(toy_sentence.audio).mfcc()
    found = build_speech(RecognisingEngine(), toy_sentence.audio, features, toy_sentence.units).log_f0
    assert found is not None
    np.testing.assert_allclose(found, log_f0(toy_sentence.audio), rtol=1e-5)

    @dataclass(frozen=True)
    class Deaf(RecognisingEngine):
        def inputs(self, motion_s: float = np.inf) -> Inputs:  # noqa: ARG002
            return Inputs()

    assert build_speech(Deaf(), toy_sentence.audio, features, toy_sentence.units).log_f0 is None


def test_the_name_of_a_file_is_no_transcript(toy_model, toy_sentence, tmp_path):
    (tmp_path / "words.txt").write_text("papa", encoding="utf-8")
    request = Request(toy_sentence.audio, transcript=str(tmp_path / "words.txt"))
    with pytest.raises(InputError, match="is the name of a file; give Path"):
        analyse(toy_model, request)


def group_words(sentence: ToySentence, late_s: float = 0.0) -> TimedTranscript:
    lines = []
    for word, spans in groupby(sentence.units, key=lambda span: span.label.word):
        inside = list(spans)
        if word:
            start_s, end_s = inside[0].start_s + late_s, inside[-1].end_s + late_s
            lines.append(TranscriptLine((TimedWord(word),), start_s, end_s))
    return TimedTranscript(tuple(lines))


def test_subtitles_are_aligned_within_their_times(toy_model, toy_sentence, tmp_path):
    (tmp_path / "said.srt").write_text(
        f"00:00:00,300 --> 00:00:02,600\n<i>{' '.join(toy_sentence.words)}</i>\n", encoding="utf-8"
    )
    plain = Request(toy_sentence.audio, transcript=" ".join(toy_sentence.words), recogniser="own")
    wanted = analyse(toy_model, plain)
    text = (tmp_path / "said.srt").read_text(encoding="utf-8")
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


def test_words_of_an_installed_recogniser_are_aligned(toy_model, toy_sentence, monkeypatch):
    said = [group_words(toy_sentence), None]
    monkeypatch.setattr(pipeline_analysis, "recognise_words", lambda _, kind: said.pop(0) if kind == "vosk" else None)
    request = Request(toy_sentence.audio, recogniser="vosk")
    found = analyse(toy_model, request)
    words = tuple(span.label.word for span in found.units if span.label.word)
    assert tuple(word for word, _ in groupby(words)) == toy_sentence.words
    assert found.units_known
    nothing = analyse(toy_model, request)  # no words: phones are recognised
    assert not nothing.units_known
    known = analyse(toy_model, replace(request, transcript=" ".join(toy_sentence.words)))
    assert known.units == found.units
    assert not said


def test_a_transcript_beside_a_request_is_taken_if_there_is_no_other():
    assert as_request(Request("a.wav"), "papa").transcript == "papa"
    assert as_request("a.wav", "papa").transcript == "papa"
    with pytest.raises(InputError, match="give one"):
        as_request(Request("a.wav", "mama"), "papa")


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
    assert caplog.messages == [
        "the transcript is not used: the units already say what is spoken; leave one of them out"
    ]


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
    understood = replace(analyse_speech(toy_model, request), recognition=recognition, range_db=range_db, fit=None)
    outlook = predict_outlook(request, understood)
    assert outlook.advice == advice
    assert outlook.text.endswith(f"would help most: {advice[0]}")


def test_the_outlook_says_how_much_of_the_speech_a_transcript_fits(toy_model, toy_sentence):
    request = Request(toy_sentence.audio, transcript=" ".join(toy_sentence.words))
    understood = replace(analyse_speech(toy_model, request), range_db=30.0)
    assert understood.fit is not None
    whole = predict_outlook(request, understood)
    assert (whole.confidence, whole.text) == (pytest.approx(1), "words: transcript; levels 30 dB apart")
    part = predict_outlook(request, replace(understood, fit=TranscriptFit(-2.0, ((0.0, 3.0),), 4.0)))
    assert (part.confidence, part.advice) == (pytest.approx(0.25), (WHOLE_TRANSCRIPT,))
    assert part.text.startswith("words: transcript, which fits 25% of the speech; levels 30 dB apart; would help most")
    wrong = predict_outlook(request, replace(understood, fit=TranscriptFit(-7.0, (), 4.0)))
    assert wrong.confidence == pytest.approx(0)
