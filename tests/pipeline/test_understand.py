"""Who says which phones were spoken, where nobody wrote them down."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from lipmotion.engines import Engine
from lipmotion.errors import InputError
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import SpeechRequest, request_of
from lipmotion.pipeline.understand import recognised_speech, speech_of, understand
from lipmotion.speech.f0 import log_f0
from lipmotion.speech.mfcc import mfcc
from lipmotion.speech.recogniser import Recogniser
from lipmotion.testing.toy import ToySentence
from lipmotion.types import Speech, Timeline, Unit


@dataclass(frozen=True)
class RecognisingEngine(Engine[Any]):
    """Recognises the phones that it is given."""

    config: Any = None
    found: Timeline[Unit] | None = None
    name: ClassVar[str] = "recognising"
    wants_f0: ClassVar[bool] = True  # type: ignore[misc]

    def recognise(self, model: object, speech: Speech) -> Timeline[Unit] | None:  # noqa: ARG002
        assert len(speech.units) == 0
        return self.found

    def fit(self, examples: object, monitor: object) -> Any: ...
    def generate(self, model: object, speech: object, constraints: object = None) -> Any: ...
    def to_arrays(self, model: object) -> Any: ...
    def from_arrays(self, arrays: object) -> Any: ...


RECOGNISED: Timeline[Unit] = Timeline(())


def recognised(engine: Engine[Any], model: Model, sentence: ToySentence, kind: str = "own") -> Speech:
    phones, features = Recogniser(model.phones, kind), mfcc(sentence.audio)
    return recognised_speech(engine, None, sentence.audio, features, phones, lambda: RECOGNISED)


def test_phones_that_the_engine_recognises_are_aligned_as_in_training(
    toy_model: Model, toy_sentence: ToySentence
) -> None:
    """Its phones, with the times of forced alignment, and no words."""
    late = toy_sentence.units.shifted(0.07)
    speech = recognised(RecognisingEngine(found=late), toy_model, toy_sentence)
    assert [s.label.phone for s in speech.units] == [s.label.phone for s in toy_sentence.units]
    assert {s.label.word for s in speech.units} == {""}
    aligned = Recogniser(toy_model.phones, "own").align_phones(toy_sentence.audio, mfcc(toy_sentence.audio), late)
    assert speech.units == aligned
    errors = [abs(a.start_s - b.start_s) for a, b in zip(speech.units, toy_sentence.units, strict=True)]
    assert np.median(errors) < 0.03


def test_the_recogniser_says_what_the_engine_does_not_know(toy_model: Model, toy_sentence: ToySentence) -> None:
    assert recognised(RecognisingEngine(), toy_model, toy_sentence).units is RECOGNISED


def test_general_models_alone_are_taken_by_their_word(toy_model: Model, toy_sentence: ToySentence) -> None:
    assert (
        recognised(RecognisingEngine(found=toy_sentence.units), toy_model, toy_sentence, "general").units is RECOGNISED
    )


def test_phones_that_do_not_fit_are_not_taken(toy_model: Model, toy_sentence: ToySentence) -> None:
    spans = toy_sentence.units.spans[1:-1]
    crowd = [span for n in range(30) for span in Timeline(spans).shifted(3.0 * n)]
    assert recognised(RecognisingEngine(found=Timeline(tuple(crowd))), toy_model, toy_sentence).units is RECOGNISED


def test_f0_is_computed_for_engines_that_want_it(toy_sentence: ToySentence) -> None:
    features = mfcc(toy_sentence.audio)
    found = speech_of(RecognisingEngine(), toy_sentence.audio, features, toy_sentence.units).log_f0
    assert found is not None
    np.testing.assert_array_equal(found, log_f0(toy_sentence.audio))

    @dataclass(frozen=True)
    class Deaf(RecognisingEngine):
        wants_f0: ClassVar[bool] = False  # type: ignore[misc]

    assert speech_of(Deaf(), toy_sentence.audio, features, toy_sentence.units).log_f0 is None


def test_the_name_of_a_file_is_no_transcript(toy_model: Model, toy_sentence: ToySentence, tmp_path: Path) -> None:
    (tmp_path / "words.txt").write_text("papa", encoding="utf-8")
    request = SpeechRequest(toy_sentence.audio, transcript=str(tmp_path / "words.txt"))
    with pytest.raises(InputError, match="is the name of a file; give Path"):
        understand(toy_model, request)


def test_a_transcript_beside_a_request_is_taken_if_there_is_no_other() -> None:
    assert request_of(SpeechRequest("a.wav"), "papa").transcript == "papa"
    assert request_of("a.wav", "papa").transcript == "papa"
    with pytest.raises(InputError, match="give one"):
        request_of(SpeechRequest("a.wav", "mama"), "papa")
