"""A text said by the recordings of a corpus, and the motion that belongs to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lipmotion import Corpus, Model, Selection, train
from lipmotion.engines import engine_named
from lipmotion.errors import InputError
from lipmotion.hmm.model import HmmConfig
from lipmotion.pipeline.generate.speak import REST_S, speak_from_corpus
from lipmotion.units import Lexicon

SETTINGS = {"joint_recogniser": False, "articulation": False, "conditions": 0}


@pytest.fixture(scope="module")
def selection_model(toy_corpus: Corpus) -> Model:
    """A model of the recordings of the toy corpus."""
    engine = engine_named("selection", SETTINGS)
    small = HmmConfig(mixtures=1, iterations=3)
    return train(toy_corpus, selection=Selection(None), engine=engine, recogniser=small)[0]


@pytest.mark.long
def test_a_recorded_sentence_is_said_by_its_recording(toy_corpus: Corpus, selection_model: Model) -> None:
    name = toy_corpus.names()[0]
    utterance = toy_corpus.utterance(name)
    assert utterance.words
    assert repr(selection_model.learned).startswith("SelectionModel(12 recordings, ")
    sound, generation = speak_from_corpus(" ".join(utterance.words), toy_corpus, selection_model)
    spoken = [span for span in generation.units if span.label.phone not in ("sil", "sp")]
    assert [span.label.phone for span in spoken] == [
        phone for word in utterance.words for phone in Lexicon().pronunciations(word)[0]
    ]
    sources = {span.label.unit.split(" ")[0] for span in spoken}
    assert sources <= set(toy_corpus.names())
    assert sound.duration_s == pytest.approx(generation.units[-1].end_s, abs=0.02)
    assert len(generation.motion.values) == pytest.approx(sound.duration_s * 100, abs=2)


def test_sound_and_motion_are_in_step(toy_corpus: Corpus, selection_model: Model) -> None:
    sound, generation = speak_from_corpus("Mama now, see papa.", toy_corpus, selection_model)
    opening = generation.motion["opening"]
    loud = np.array([np.abs(sound.samples[n * 160 : (n + 1) * 160]).max() for n in range(len(sound.samples) // 160)])
    for span in generation.units:
        inside = slice(int(span.start_s * 100) + 2, int(span.end_s * 100) - 1)
        if span.label.phone == "aa" and inside.stop - inside.start > 2:
            assert opening[inside].max() > 0.12
            assert loud[inside].max() > 0.05
        if span.label.phone == "m":
            assert opening[int(span.start_s * 100) : int(span.end_s * 100) + 1].min() < 0.08
    assert generation.units[0].label.phone == "sil"
    assert generation.units[0].end_s <= REST_S + 1e-6


def test_sources_are_the_recordings_whose_sound_is_joined(toy_corpus: Corpus, selection_model: Model) -> None:
    sound, generation = speak_from_corpus("baby blue", toy_corpus, selection_model)
    found = []
    for span in generation.units:
        recording, times = span.label.unit.split(" ")[:2]
        if span.label.phone in ("sil", "sp") or span.duration_s < 0.05:
            continue
        start_s, end_s = map(float, times.split("-"))
        source = toy_corpus.utterance(recording).audio.samples
        middle = (span.start_s + span.end_s) / 2
        piece = sound.samples[int((middle - 0.01) * 16_000) : int((middle + 0.01) * 16_000)]
        area = np.asarray(source[max(int((start_s - 0.05) * 16_000), 0) : int((end_s + 0.05) * 16_000)], float)
        likeness = np.correlate(area, piece, "valid")
        norms = np.sqrt(np.convolve(area**2, np.ones(len(piece)), "valid") * float(piece @ piece))
        if float(piece @ piece) > 1e-3:
            found.append((likeness / np.maximum(norms, 1e-9)).max())
    assert np.mean(np.array(found) > 0.8) > 0.6  # motion is chosen again, by the features of the joined sound


def test_a_model_without_recordings_is_refused(toy_corpus: Corpus, toy_model: Model) -> None:
    with pytest.raises(InputError, match="--engine selection"):
        speak_from_corpus("baby blue", toy_corpus, toy_model)


def test_another_corpus_is_refused(selection_model: Model, tmp_path) -> None:
    with pytest.raises(InputError, match="lacks"):
        speak_from_corpus("baby blue", Corpus.create(tmp_path / "empty"), selection_model)


def test_phones_that_were_never_recorded_are_named(
    toy_corpus: Corpus, selection_model: Model, caplog: pytest.LogCaptureFixture
) -> None:
    speak_from_corpus("baby blue", toy_corpus, selection_model)
    assert "do not have" not in caplog.text
    speak_from_corpus("judge", toy_corpus, selection_model)
    assert "jh (" in caplog.text


def test_recordings_of_several_people_are_refused(toy_corpus: Corpus, selection_model: Model, monkeypatch) -> None:
    names = iter("ab" * 20)
    known = toy_corpus.utterance
    monkeypatch.setattr(toy_corpus, "utterance", lambda name: replace(known(name), speaker=next(names)))
    with pytest.raises(InputError, match="recordings of 2 people"):
        speak_from_corpus("baby blue", toy_corpus, selection_model)
