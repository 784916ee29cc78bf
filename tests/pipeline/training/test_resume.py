import multiprocessing
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from lipmotion import Corpus, Model, Run, save_model, train
from lipmotion.engines import engine_named
from lipmotion.errors import CorpusError, MissingDependencyError
from lipmotion.formats.label_files import write_labels
from lipmotion.pipeline import workers
from lipmotion.pipeline.training import labels
from lipmotion.pipeline.training.other_speakers import align_recordings, is_held_out_speaker, synthesise_sentences
from lipmotion.speech.sound.acoustic_conditions import mark_spoken
from lipmotion.speech.voices.synthesiser import SyntheticVoice
from lipmotion.types import Audio, Item, Monitor, Progress, Timeline, Unit, silent_monitor
from lipmotion.units import Lexicon, split_words
from pipeline.made import recogniser_of, write_sound
from testing.formant_synthesiser import synthesise
from testing.toy import SMALL, toy_sentences

CONFIG = replace(SMALL, mixtures=2, iterations=1, context_frames=20)


class Stopped(Exception):  # noqa: N818
    pass


def stopping_after(events: int) -> Monitor:
    reports: list[object] = []

    def monitor(event: Progress | Item) -> None:
        reports.append(event)
        if len(reports) == events:
            raise Stopped

    return monitor


@pytest.fixture
def few_utterances(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process has one of them to do, and a checkpoint two."""
    monkeypatch.setattr(workers, "UTTERANCES_PER_WORKER", 1)
    monkeypatch.setattr(labels, "UTTERANCES_PER_CHECKPOINT", 2)


@pytest.fixture
def work(tmp_path: Path) -> Path:
    folder = tmp_path / "work"
    folder.mkdir()
    return folder


@pytest.fixture(scope="module")
def corpus(toy_corpus: Corpus, tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    """Five good utterances, and one whose words do not fit."""
    small = Corpus.create(tmp_path_factory.mktemp("resume") / "corpus")
    for name in toy_corpus.names("train")[:6]:
        utterance = toy_corpus.utterance(name)
        small.add(utterance if name != "toy02" else replace(utterance, words=("five",) * 100))
    return small


def run(corpus: Corpus, work: Path | None = None, monitor: Monitor = silent_monitor) -> Model:
    return train(corpus, recogniser=CONFIG, run=Run(work=work, monitor=monitor))[0]


def content(model: Model, folder: Path) -> bytes:
    save_model(model, folder / "model.lipmotion")
    return (folder / "model.lipmotion").read_bytes()


def create_events(corpus: Corpus, work: Path | None = None) -> list[Progress | Item]:
    events: list[Progress | Item] = []
    run(corpus, work, events.append)
    return events


@pytest.fixture(scope="module")
def whole(corpus: Corpus, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The model file of a training that nothing stops."""
    return content(run(corpus), tmp_path_factory.mktemp("whole"))


@pytest.mark.long
@pytest.mark.usefixtures("few_utterances")
def test_stopped_after_any_event(corpus, whole, work, tmp_path):
    count = len(create_events(corpus))
    assert count > 15
    for number in range(1, count + 1, 4):
        with pytest.raises(Stopped):
            run(corpus, work, stopping_after(number))
        assert content(run(corpus, work), tmp_path) == whole, number
        for path in work.iterdir():
            path.unlink()


@pytest.mark.long
@pytest.mark.usefixtures("few_utterances")
def test_threads_of_matrix_products_change_nothing(corpus, whole, tmp_path, monkeypatch):
    """Neither this process's own nor those that the processes it starts would use."""
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    with threadpool_limits(1, user_api="blas"):
        assert content(train(corpus, recogniser=CONFIG, run=Run(workers=2))[0], tmp_path) == whole
        assert {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"} == {1}


@pytest.mark.long
@pytest.mark.usefixtures("few_utterances")
def test_stopped_in_two_processes(corpus, whole, work, tmp_path):
    before = set(multiprocessing.active_children())
    with pytest.raises(Stopped):
        train(corpus, recogniser=CONFIG, run=Run(work=work, monitor=stopping_after(6), workers=2))
    assert set(multiprocessing.active_children()) == before
    assert content(train(corpus, recogniser=CONFIG, run=Run(work=work, workers=2))[0], tmp_path) == whole


@pytest.mark.long
def test_what_is_done_is_not_done_again(corpus, work):
    """What could not be used is reported again."""
    first, again = create_events(corpus, work), create_events(corpus, work)
    shares = [event.share for event in again if isinstance(event, Progress)]
    assert shares == sorted(shares)
    assert shares[0] >= 0.5  # of phones; motion is learned again
    assert shares[-1] <= 1
    items = [event for event in first if isinstance(event, Item)]
    assert [(item.name, item.outcome) for item in items] == [("toy02", "skipped")]
    assert "too short" in items[0].reason
    assert [event for event in again if isinstance(event, Item)] == items


def test_the_fingerprint_is_of_all_that_a_training_uses(toy_corpus, tmp_path):
    corpus = Corpus.create(tmp_path / "corpus")
    utterance = toy_corpus.utterance("toy00")
    engine, plain_words = engine_named("trajectory", {}), Lexicon()

    def digest(visual: str = "geometry", names=("toy00",), engine=engine, recogniser=CONFIG, lexicon=plain_words):
        return labels.fingerprint_training(corpus, names, engine, recogniser, lexicon, visual, None)

    corpus.add(utterance)
    plain, pictured = digest(), digest("both")
    others = [
        digest(names=()),
        digest(engine=engine_named("trajectory", {"states": 3})),
        digest(recogniser=replace(CONFIG, relevance=3.0)),
        digest(lexicon=Lexicon({"a": (("ax",),)})),
    ]
    assert len({plain, pictured, *others}) == 6
    crops = np.array(utterance.track.crops)
    crops[3, 4, 5] ^= 1
    corpus.add(replace(utterance, track=replace(utterance.track, crops=crops)))
    assert digest() == plain  # mouth pictures count where eigenlips are learned from them
    assert digest("both") != pictured
    corpus.add(replace(utterance, words=("papa",)))
    assert digest() != plain


VOICES = [SyntheticVoice("low", "flite", "anna"), SyntheticVoice("high", "flite", "bert")]
TEXTS = ["Blue baby.", "Five tea."]
Sayings = Iterator[tuple[Audio, Timeline[Unit], Path]]


@pytest.fixture
def spoken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every voice speaks as the formant synthesiser does, without any pause."""

    def say(texts: list[str], voice: SyntheticVoice, _: Lexicon | None) -> Sayings:
        for text in texts:
            if text == "Bee":
                yield *synthesise([("sil", 0.1), ("b", 0.1), ("iy", 0.2), ("sil", 0.2)]), Path()
                continue
            phones = [phone for word in split_words(text) for phone in Lexicon().pronunciations(word)[0]]
            yield *synthesise([(phone, 0.12) for phone in phones], pitch_hz=100 if voice.name == "low" else 200), Path()

    monkeypatch.setattr("lipmotion.pipeline.training.other_speakers.speak_sentences", say)


@pytest.mark.usefixtures("spoken")
def test_every_text_in_every_voice():
    sentences = list(synthesise_sentences(TEXTS, VOICES))
    assert [sentence.name for sentence in sentences] == [
        "flite-low-001", "flite-low-002", "flite-high-001", "flite-high-002",
    ]  # fmt: skip
    assert [sentence.speaker for sentence in sentences] == ["anna", "anna", "bert", "bert"]
    assert [s.name for s in synthesise_sentences(TEXTS, VOICES[1:])] == ["flite-high-001", "flite-high-002"]
    for one, other in zip(sentences, synthesise_sentences(TEXTS, VOICES), strict=True):  # the same again
        assert np.array_equal(one.audio.samples, other.audio.samples)
        assert one.phones == other.phones


@pytest.mark.usefixtures("spoken")
def test_sentences_stand_between_pauses_over_a_faint_noise():
    for sentence in synthesise_sentences(TEXTS, VOICES):
        first, last = sentence.phones[0], sentence.phones[-1]
        assert first.label == last.label == Unit("sil")
        assert (first.start_s, first.end_s) == (0, 0.25)
        assert last.end_s == pytest.approx(sentence.audio.duration_s)
        assert last.duration_s == pytest.approx(0.25)
        assert all(a.end_s == b.start_s for a, b in pairwise(sentence.phones))
        loud = sentence.audio.samples[mark_spoken(sentence.audio)].std()
        for part in (sentence.audio.samples[:4000], sentence.audio.samples[-4000:]):
            assert 20 * np.log10(loud / part.std()) == pytest.approx(50, abs=0.6)
    (sentence,) = synthesise_sentences(["Bee"], VOICES[:1])
    assert [span.label.phone for span in sentence.phones] == ["sil", "b", "iy", "sil"]
    assert [span.start_s for span in sentence.phones] == pytest.approx([0, 0.35, 0.45, 0.65])
    assert sentence.phones[-1].end_s == pytest.approx(1.1)


def test_sides_never_change():
    named = {"slt": True, "espeak-f2": True, "espeak-m7": True, "kal": False, "awb": False, "rms": False}
    assert {speaker: is_held_out_speaker(speaker) for speaker in named} == named


def test_a_quarter_is_kept_aside():
    held_out = [is_held_out_speaker(f"speaker {number}") for number in range(2000)]
    assert np.mean(held_out) == pytest.approx(0.25, abs=0.03)


def test_without_voices_it_says_what_to_install():
    with pytest.raises(MissingDependencyError, match="apt install flite festival festvox-us-slt-hts"):
        next(synthesise_sentences(TEXTS, ()))


def write(path: Path, audio: Audio, text: str | None = None) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_sound(path, audio)
    if text is not None:
        path.with_suffix(".txt").write_text(text, encoding="utf-8")


@pytest.fixture(scope="module")
def own(toy_model: Model) -> Any:
    return recogniser_of(toy_model)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two recordings that can be used, and four that cannot."""
    first, second, third = toy_sentences(3)
    write(tmp_path / "anna" / "one.wav", first.audio, " ".join(first.words))
    write(tmp_path / "two.wav", second.audio, " ".join(second.words).upper())
    write(tmp_path / "unsaid.wav", third.audio)
    write(tmp_path / "too long.wav", Audio(third.audio.samples[:6000], 16_000), " ".join(third.words * 4))
    write(tmp_path / "unsayable.wav", third.audio, "猫")
    (tmp_path / "broken.wav").write_bytes(b"RIFF nothing")
    (tmp_path / "broken.txt").write_text("blue", encoding="utf-8")
    return tmp_path


def test_recordings_are_aligned(folder, own):
    items: list[Item] = []
    sentences = list(align_recordings(folder, own, monitor=items.append))  # type: ignore[arg-type]
    assert [(s.name, s.speaker) for s in sentences] == [("anna-one", "anna"), ("two", "two")]
    for sentence, toy in zip(sentences, toy_sentences(3), strict=False):
        assert [span.label for span in sentence.phones] == [span.label for span in toy.units]
        late_s = [a.start_s - b.start_s for a, b in zip(sentence.phones, toy.units, strict=True)]
        assert np.median(np.abs(late_s)) < 0.04  # the toy model is a crude one
    assert {item.outcome for item in items} == {"skipped"}
    assert sorted(item.name for item in items) == ["broken", "too long", "unsayable"]


def test_librispeech_is_read_as_it_is_distributed(tmp_path, own):
    chapter = tmp_path / "LibriSpeech" / "dev-clean" / "84" / "121123"
    sentences = toy_sentences(3)
    for number, sentence in enumerate(sentences):
        write(chapter / f"84-121123-{number:04d}.flac", sentence.audio)
    lines = [f"84-121123-{number:04d} {' '.join(s.words).upper()}\n" for number, s in enumerate(sentences[:2])]
    (chapter / "84-121123.trans.txt").write_text("".join(lines))
    items: list[Item] = []
    for folder in (tmp_path, chapter.parent):
        spoken = list(align_recordings(folder, own, monitor=items.append))  # type: ignore[arg-type]
        assert [each.speaker for each in spoken] == ["84", "84"]
        for each, sentence in zip(spoken, sentences, strict=False):
            assert [span.label for span in each.phones] == [span.label for span in sentence.units]
    assert {item.reason for item in items} == {
        f"{chapter / '84-121123.trans.txt'}: has no line of 84-121123-0002; required this name, a blank and its words"
    }


def test_labelled_phones_are_used_as_they_are(tmp_path, own):
    sentence, *_ = toy_sentences(3)
    write(tmp_path / "one.wav", sentence.audio)
    write_labels(tmp_path / "one.TextGrid", sentence.units)
    (spoken,) = align_recordings(tmp_path, own)
    assert [span.start_s for span in spoken.phones] == pytest.approx([span.start_s for span in sentence.units])


def test_a_transcript_of_other_words_is_detected(folder, own):
    (folder / "two.txt").write_text("squash six fish chefs")
    items: list[Item] = []
    (sentence,) = align_recordings(folder, own, monitor=items.append)  # type: ignore[arg-type]
    assert sentence.name == "anna-one"
    (reason,) = (item.reason for item in items if item.name == "two")
    assert re.search(r"agree with the sound at -\d+\.\d, required -4\.2 or more", reason)


@pytest.mark.parametrize("name", ["nothing", ""])
def test_a_folder_without_transcripts(tmp_path, own, toy_sentence, name):
    write(tmp_path / "unsaid.wav", toy_sentence.audio)
    with pytest.raises(CorpusError, match="no such folder" if name else "no recording with a transcript"):
        next(align_recordings(tmp_path / name, own))
