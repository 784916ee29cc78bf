from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion import Corpus, Run, Selection, save_model, train
from lipmotion.engines import engine_named
from lipmotion.errors import CorpusError, InputError
from lipmotion.hmm.model import HmmConfig
from lipmotion.motion.space import resample_track
from lipmotion.pipeline.training import train as module
from lipmotion.pipeline.training.other_speakers import SpokenSentence
from lipmotion.pipeline.training.train import describe_training, label_phones
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.types import Channel, Motion, Track, Utterance
from lipmotion.units import Lexicon
from pipeline import made
from testing.toy import toy_sentences

SMALL, JOINT = HmmConfig(mixtures=1, iterations=2), engine_named("joint", {})
TRAINED = tuple(f"toy0{number}" for number in range(8))


def some(corpus: Corpus, count: int = 5) -> list[Utterance]:
    return [corpus.utterance(name) for name in corpus.names("train")[:count]]


def corpus_of(utterances: Iterable[Utterance], folder: Path) -> Corpus:
    return made.corpus_of(folder / "corpus", utterances)


@pytest.mark.long
def test_other_lists_all_and_given_names(toy_corpus, tmp_path):
    assert train(toy_corpus, selection=Selection("val"), recogniser=SMALL, engine=JOINT)[1].used == ("toy08", "toy09")
    few = corpus_of([toy_corpus.utterance(name) for name in ("toy10", "toy02", "toy03")], tmp_path)
    for selection, used, split in (
        (Selection(None), ("toy02", "toy03", "toy10"), "all"),
        (Selection(names=("toy10", "toy02")), ("toy10", "toy02"), "given names"),
    ):
        model, report = train(few, selection=selection, recogniser=SMALL, engine=JOINT)
        assert (report.used, model.about["split"]) == (used, split)
    with pytest.raises(CorpusError, match=r"no utterances of split 'tset' \(there are train: 8, val: 2, test: 2\)"):
        train(toy_corpus, selection=Selection("tset"))
    with pytest.raises(CorpusError, match="no utterance 'toy99' among 12"):
        train(toy_corpus, selection=Selection(names=("toy00", "toy99")))


@pytest.mark.long
def test_untranscribed_utterances_are_recognised_and_used(toy_corpus, tmp_path, caplog):
    utterances = some(toy_corpus, 8)
    utterances[5] = replace(utterances[5], words=None)
    mixed = corpus_of(utterances, tmp_path)
    model, report = train(mixed, recogniser=SMALL, engine=JOINT)
    assert report.used == TRAINED
    assert "1 of 8 recordings have no words: their phones are recognised" in caplog.text
    recogniser = Recogniser(model.phones, "own")
    found, known = (
        [span.label.phone for span in label_phones(corpus.utterance("toy05"), recogniser, Lexicon())]
        for corpus in (mixed, toy_corpus)
    )
    assert np.mean([phone in found for phone in known]) > 0.8


def labelled(utterance: Utterance) -> Utterance:
    return replace(utterance, words=None, phones=made.true_phones(utterance))


@pytest.mark.long
def test_labelled_phones_are_used_as_they_are(toy_corpus, toy_model, tmp_path, monkeypatch):
    """Nothing is aligned, no transcript is needed, and phone models are trained on what is labelled."""
    monkeypatch.setattr(module, "align_or_recognise", None)
    given = [labelled(utterance) for utterance in some(toy_corpus, 8)]
    given[0] = replace(given[0], words=("not", "what", "is", "said"))
    model, report = train(corpus_of(given, tmp_path), recogniser=SMALL, engine=JOINT)
    assert report.used == TRAINED
    assert report.skipped == {}
    assert set(model.phones.table.units) == set(toy_model.phones.table.units)
    assert label_phones(given[0], Recogniser(model.phones, "own"), Lexicon()) == given[0].phones


@pytest.mark.long
def test_labelled_and_transcribed_utterances_together(toy_corpus, tmp_path):
    both = [u if number % 2 else labelled(u) for number, u in enumerate(some(toy_corpus, 8))]
    model, report = train(corpus_of(both, tmp_path), recogniser=SMALL, engine=JOINT)
    assert (report.used, report.skipped) == (TRAINED, {})
    truth = labelled(toy_corpus.utterance("toy11"))
    assert truth.phones is not None
    recognised = [
        s.label.phone for s in label_phones(replace(truth, phones=None), Recogniser(model.phones, "own"), Lexicon())
    ]
    assert np.mean([span.label.phone in recognised for span in truth.phones]) > 0.8


@pytest.mark.long
def test_a_transcript_that_does_not_fit_is_skipped_and_reported(toy_corpus, tmp_path):
    utterances = some(toy_corpus)
    utterances[1] = replace(utterances[1], words=("five",) * 100)
    utterances[2] = replace(utterances[2], words=("mama", "日本"))
    model, report = train(corpus_of(utterances, tmp_path), recogniser=SMALL, engine=JOINT)
    assert report.used == ("toy00", "toy03", "toy04")
    assert set(report.skipped) == {"toy01", "toy02"}
    assert "too short" in report.skipped["toy01"]
    assert "how '日本' is said" in report.skipped["toy02"]
    assert model.about["utterances"] == 3


@pytest.mark.long
def test_without_any_transcript_the_shipped_phones_are_used(toy_corpus, toy_model, tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(module, "load_model", lambda: toy_model)
    silent = corpus_of([replace(utterance, words=None) for utterance in some(toy_corpus)], tmp_path)
    model, report = train(silent, recogniser=SMALL, engine=JOINT)
    assert model.phones.mixtures is toy_model.phones.mixtures
    assert not np.array_equal(model.phones.speaker, toy_model.phones.speaker)  # whose voice it is, is learned
    assert len(report.used) == 5
    assert "no transcripts in the corpus: its phones are recognised by the shipped model" in caplog.text


@pytest.mark.long
def test_guessed_words_are_reported(toy_corpus, tmp_path, caplog):
    names = {"papa": "pahpa", "mama": "mahma"}
    utterances = [replace(u, words=tuple(names.get(w, w) for w in u.words or ())) for u in some(toy_corpus, 4)]
    train(
        corpus_of(utterances, tmp_path),
        recogniser=SMALL,
        engine=JOINT,
        lexicon=Lexicon({"mahma": (("m", "aa", "m", "ax"),)}),
    )
    assert [record.getMessage().split()[0] for record in caplog.records] == ["'pahpa'"]


def test_licence_and_attribution_go_with_the_model(toy_corpus):
    rights = [{"licence": "CC0"}, {"licence": "CC BY 4.0", "attribution": "Anna"}, {"attribution": "Anna"}, {}]
    given = [replace(u, source=source) for u, source in zip(some(toy_corpus, 4), rights, strict=True)]
    about = describe_training(toy_corpus, given, "train", 4)
    assert about["licence"] == ["CC BY 4.0", "CC0"]
    assert about["attribution"] == ["Anna"]
    assert about["corpus"] == ["toy"]
    assert set(about["versions"]) == {"lipmotion", "numpy", "scipy"}
    assert about["minutes"] == pytest.approx(0.2, abs=0.05)


def test_nothing_usable(toy_corpus, tmp_path):
    wrong = corpus_of([replace(u, words=("five",) * 100) for u in some(toy_corpus, 2)], tmp_path)
    with pytest.raises(CorpusError, match="none of 2 utterances has a transcript that fits"):
        train(wrong, recogniser=SMALL)


def test_frames_without_a_face_are_not_learned_from(toy_corpus):
    track = toy_corpus.utterance("toy00").track
    seen = np.arange(len(track.seen)) % 10 > 1
    _, valid = resample_track(replace(track, seen=seen), 250)
    nearest = np.minimum(np.floor(np.arange(250) / 4 + 0.5).astype(int), len(seen) - 1)
    assert np.array_equal(valid, seen[nearest])


def test_camera_frames_become_model_frames():
    curve = np.sin(np.arange(26) / 25 * 2 * np.pi)[:, None]
    motion, valid = resample_track(Track(Motion(curve, 25.0, (Channel("opening"),)), np.ones(26, bool)), 111)
    assert motion.values[:101, 0] == pytest.approx(np.sin(np.arange(101) / 100 * 2 * np.pi), abs=0.01)
    assert valid[:101].all()
    assert not valid[103:].any()  # half a camera frame after the last one


def others() -> Iterator[SpokenSentence]:
    """Two speakers of whom nothing was seen."""
    for number, sentence in enumerate(toy_sentences(4)):
        yield SpokenSentence(sentence.name, ("bert", "anna")[number % 2], sentence.audio, sentence.units)


def test_voices_of_others_teach_engines_that_have_a_use_for_them(toy_corpus):
    stages: list[str] = []
    plain = {"states": 1, "asynchrony": 0, "mixtures": 1, "acoustic_regression": False, "variance_scaling": False}
    engine = engine_named("coupled", plain | {"speech_only_mixtures": 1})
    chosen = {"selection": Selection(names=TRAINED[:4]), "recogniser": SMALL, "engine": engine}
    model, report = train(
        toy_corpus, **chosen, voices=others(), run=Run(monitor=lambda event: stages.append(event.stage))
    )
    alone, _ = train(toy_corpus, **chosen)
    assert model.about["voices"] == ["anna", "bert"]
    assert model.about["utterances"] == 4
    assert report.used == TRAINED[:4]
    assert "voices" not in alone.about
    assert {"aligning other voices", "learning motion: more speech"} <= set(stages)
    speech, lips = ([one.learned.chains.groups[group].mixtures.means for one in (model, alone)] for group in (0, 1))
    assert np.abs(speech[0] - speech[1]).max() > 0.1
    assert lips[0].tobytes() == lips[1].tobytes()


def test_other_engines_have_no_use_for_voices(toy_corpus):
    with pytest.raises(InputError, match="the engine 'joint' does not learn from other voices"):
        train(toy_corpus, engine=engine_named("joint", {}), voices=others())


def test_the_training_list_is_used_and_gives_the_same_model(toy_corpus, joint_model, tmp_path):
    model, report = train(toy_corpus, recogniser=SMALL, engine=JOINT)
    for name, each in (("first", joint_model), ("again", model)):
        save_model(each, tmp_path / f"{name}.lipmotion")
    assert (tmp_path / "again.lipmotion").read_bytes() == (tmp_path / "first.lipmotion").read_bytes()
    assert (report.used, report.skipped) == (TRAINED, {})
    assert report.figures["frames"] > 1500
    assert (model.about["split"], model.about["utterances"]) == ("train", 8)


@pytest.mark.long
def test_configurations_are_used_and_every_stage_is_reported(toy_corpus):
    steps: list[str] = []
    engine = engine_named("trajectory", {"states": 3})
    run = Run(monitor=lambda event: steps.append(event.stage))
    few, config = Selection(names=TRAINED[:4]), replace(SMALL, states=2)
    model, _ = train(toy_corpus, selection=few, engine=engine, recogniser=config, run=run)
    assert model.engine is engine
    assert model.phones.table.count("aa") == 2
    assert list(dict.fromkeys(steps))[:2] == ["learning phones: flat start", "learning phones: pronunciations"]
    assert "learning motion: trees" in steps
