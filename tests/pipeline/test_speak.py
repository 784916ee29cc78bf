import shutil
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from lipmotion import Corpus, Model, Selection, load_model, speak, train
from lipmotion.engines import engine_named
from lipmotion.errors import InputError
from lipmotion.pipeline.generate import speak as module
from lipmotion.pipeline.generate.speak import REST_S, speak_from_corpus
from lipmotion.speech.voices.installed import choose_voice
from lipmotion.types import Span, SpokenText, Unit
from lipmotion.units import LIP_CLOSING, Lexicon, is_silent
from pipeline.made import corpus_of
from speech import stand_in_voice
from testing.toy import SMALL

TEXT = "Papa, see Bob. Mama!"


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in_voice.install(monkeypatch)


@pytest.fixture
def spoken(stand_in: None, toy_model: Model) -> SpokenText:  # noqa: ARG001
    return speak(TEXT, model=toy_model)


def phones(spoken: SpokenText) -> str:
    return " ".join(span.label.phone for span in spoken.generation.units)


def test_sound_and_motion_are_of_the_same_length(spoken):
    sound, generation = spoken
    assert sound.rate_hz == stand_in_voice.RATE_HZ
    assert len(generation.motion.values) == round(sound.duration_s * 100) + 1
    assert phones(spoken) == "sil p aa p ax s iy b aa b sp m aa m ax sil"
    assert list(dict.fromkeys(span.label.word for span in generation.units)) == ["", "papa", "see", "bob", "mama"]
    assert generation.outlook.words == "given units"


@pytest.mark.parametrize(
    "text", ["[00:00.5]Papa, see Bob.\n[00:02]Mama!", "1\n00:00:00,500 --> 00:00:02,000\nPAPA: {0}\n"]
)
@pytest.mark.usefixtures("stand_in")
def test_times_of_subtitles_are_not_spoken(toy_model, text, caplog):
    assert phones(speak(text.format(TEXT), model=toy_model)) == phones(speak(TEXT, model=toy_model))
    assert "subtitles" in caplog.text


def test_tags_in_the_text_are_moods_and_not_spoken(stand_in: None, toy_model: Model) -> None:  # noqa: ARG001
    sound, generation = speak("<smile> Papa, see Bob. [sad] Mama!", model=toy_model)
    assert sound.duration_s == speak(TEXT, model=toy_model).sound.duration_s
    first, second = generation.moods
    assert (first.time_s, first.mood, second.mood) == (0.0, "happy", "sad")
    assert second.time_s == pytest.approx(next(s.start_s for s in generation.units if s.label.phone == "m"))


def test_the_units_cover_all_with_rest_at_both_ends(spoken):
    units = spoken.generation.units
    assert units[0].start_s == 0
    assert units[0].end_s == pytest.approx(REST_S, abs=1e-3)
    assert units[-1].end_s == pytest.approx(spoken.sound.duration_s)
    assert units[-1].duration_s == pytest.approx(REST_S, abs=1e-3)
    assert all(a.end_s == b.start_s for a, b in pairwise(units))


def test_the_sound_is_silent_where_the_units_are(spoken):
    samples, rate_hz = spoken.sound.samples, spoken.sound.rate_hz
    assert 0 < np.abs(samples[: round(0.1 * rate_hz)]).max() < 0.02 * np.abs(samples).max()  # noise, no digital silence
    loud = {
        span.label.phone: float(np.abs(samples[round(span.start_s * rate_hz) : round(span.end_s * rate_hz)]).max())
        for span in spoken.generation.units
    }
    assert loud["aa"] > 5 * loud["sil"]


def test_neighbouring_silences_are_one_and_short_ones_are_pauses():
    spans = [
        Span(0.3, 0.5, Unit("aa")), Span(0.5, 0.6, Unit("sil")), Span(0.6, 0.65, Unit("sil")),
        Span(0.65, 0.8, Unit("p")), Span(0.8, 1.0, Unit("sil")), Span(1.05, 1.2, Unit("p")),
    ]  # fmt: skip
    joined = [(span.label.phone, span.start_s, span.end_s) for span in module._join_silences(spans, 1.5)]
    assert joined == [
        ("sil", 0.0, 0.3), ("aa", 0.3, 0.5), ("sp", 0.5, 0.65), ("p", 0.65, 0.8), ("sil", 0.8, 1.05),
        ("p", 1.05, 1.2), ("sil", 1.2, 1.5),
    ]  # fmt: skip


@pytest.mark.skipif(not any(map(shutil.which, ("flite", "festival", "espeak-ng"))), reason="no synthesiser is here")
def test_a_real_voice_closes_the_lips_in_time():
    spoken = speak("Please bring my mother the blue ball.", voice=choose_voice(), model=load_model())
    opening = spoken.generation.motion["opening"]
    closing = [span for span in spoken.generation.units if span.label.phone in LIP_CLOSING]
    assert [span.label.word for span in closing] == ["please", "bring", "my", "mother", "blue", "ball"]
    for span in closing:
        assert opening[round(span.start_s * 100) : round(span.end_s * 100) + 1].min() < 0.1 * np.percentile(opening, 95)
    assert is_silent(spoken.generation.units[0].label.phone)


SETTINGS = {"joint_recogniser": False, "articulation": False, "conditions": 0}


@pytest.fixture(scope="module")
def selection_model(toy_corpus: Corpus) -> Model:
    engine = engine_named("selection", SETTINGS)
    return train(toy_corpus, selection=Selection(None), engine=engine, recogniser=SMALL)[0]


@pytest.mark.long
def test_a_recorded_sentence_is_said_by_its_recording(toy_corpus, selection_model):
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


@pytest.mark.long
def test_sound_and_motion_are_in_step(toy_corpus, selection_model):
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


@pytest.mark.long
def test_sources_are_the_recordings_whose_sound_is_joined(toy_corpus, selection_model):
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


@pytest.mark.long
def test_phones_that_were_never_recorded_are_named(toy_corpus, selection_model, caplog):
    speak_from_corpus("baby blue", toy_corpus, selection_model)
    assert "do not have" not in caplog.text
    speak_from_corpus("judge", toy_corpus, selection_model)
    assert "jh (" in caplog.text


def test_a_model_without_recordings_is_refused(toy_corpus, toy_model):
    with pytest.raises(InputError, match="--engine selection"):
        speak_from_corpus("baby blue", toy_corpus, toy_model)


@pytest.mark.long
def test_another_corpus_is_refused(selection_model, tmp_path):
    with pytest.raises(InputError, match="lacks"):
        speak_from_corpus("baby blue", Corpus.create(tmp_path / "empty"), selection_model)


@pytest.mark.long
def test_recordings_of_several_people_are_refused(toy_corpus, selection_model, tmp_path):
    utterances = map(toy_corpus.utterance, toy_corpus.names())
    two = corpus_of(tmp_path / "two", [replace(each, speaker="ab"[n % 2]) for n, each in enumerate(utterances)])
    with pytest.raises(InputError, match="recordings of a, b, required one person"):
        speak_from_corpus("baby blue", two, selection_model)
