import logging
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from conftest import quickly
from lipmotion import Corpus, Run, Selection, animate, evaluate, load_model, save_model, train
from lipmotion.engines import engine_named
from lipmotion.errors import CorpusError, InputError
from lipmotion.motion.eigenlips import Eigenlips, fit_eigenlips
from lipmotion.pipeline.training import labels
from lipmotion.pipeline.training.channels import train_eigenlips, with_visual_channels
from lipmotion.pipeline.training.other_speakers import SpokenSentence
from lipmotion.pipeline.training.train import describe_training, label_phones
from lipmotion.speech.recognition.general import load_general
from lipmotion.types import Span, Timeline, Unit, Utterance
from lipmotion.units import Lexicon
from lipmotion_lab.evaluation.held_out import generate_clips, load_held_out
from lipmotion_lab.evaluation.table import format_figures
from pipeline import made
from pipeline.made import corpus_of, recogniser_of
from testing.toy import SMALL, toy_sentences, toy_utterances

JOINT = engine_named("joint", {})
TRAINED = tuple(f"toy0{number}" for number in range(8))


def some(corpus: Corpus, count: int = 5) -> list[Utterance]:
    return [corpus.utterance(name) for name in corpus.names("train")[:count]]


@pytest.mark.long
def test_other_lists_all_and_given_names(toy_corpus, tmp_path):
    assert train(toy_corpus, selection=Selection("val"), recogniser=SMALL, engine=JOINT)[1].used == ("toy08", "toy09")
    few = corpus_of(tmp_path, [toy_corpus.utterance(name) for name in ("toy10", "toy02", "toy03")])
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
    mixed = corpus_of(tmp_path, utterances)
    model, report = train(mixed, recogniser=SMALL, engine=JOINT)
    assert report.used == TRAINED
    assert "1 of 8 recordings have no transcript (toy05): phones are recognised" in caplog.text
    recogniser = recogniser_of(model)
    found, known = (
        [span.label.phone for span in label_phones(corpus.utterance("toy05"), recogniser, Lexicon())]
        for corpus in (mixed, toy_corpus)
    )
    assert np.mean([phone in found for phone in known]) > 0.8


def labelled(utterance: Utterance) -> Utterance:
    return replace(utterance, words=None, phones=made.true_phones(utterance))


@pytest.mark.long
def test_labelled_phones_are_used_as_they_are(toy_corpus, toy_model, tmp_path):
    """Nothing is aligned, no transcript is needed, and phone models are trained on what is labelled."""
    given = [labelled(utterance) for utterance in some(toy_corpus, 8)]
    given[0] = replace(given[0], words=("not", "what", "is", "said"))
    model, report = train(corpus_of(tmp_path, given), recogniser=SMALL, engine=JOINT)
    assert report.used == TRAINED
    assert report.skipped == {}
    assert set(model.phones.table.units) == set(toy_model.phones.table.units)
    assert label_phones(given[0], recogniser_of(model), Lexicon()) == given[0].phones


@pytest.mark.long
def test_a_transcript_that_does_not_fit_is_skipped_and_reported(toy_corpus, tmp_path):
    utterances = some(toy_corpus)
    utterances[1] = replace(utterances[1], words=("five",) * 100)
    utterances[2] = replace(utterances[2], words=("mama", "日本"))
    model, report = train(corpus_of(tmp_path, utterances), recogniser=SMALL, engine=JOINT)
    assert report.used == ("toy00", "toy03", "toy04")
    assert set(report.skipped) == {"toy01", "toy02"}
    assert "too short" in report.skipped["toy01"]
    assert "how '日本' is said" in report.skipped["toy02"]
    assert model.about["utterances"] == 3


@pytest.mark.long
def test_without_any_transcript_the_shipped_phones_are_used(toy_corpus, tmp_path, caplog):
    silent = corpus_of(tmp_path, [replace(utterance, words=None) for utterance in some(toy_corpus)])
    model, report = train(silent, recogniser=SMALL, engine=JOINT)
    assert model.phones.mixtures is load_model().phones.mixtures
    assert not np.array_equal(model.phones.speaker, load_model().phones.speaker)  # whose voice it is, is learned
    assert len(report.used) == 5
    assert "no transcripts in the corpus: its phones are recognised by the shipped model" in caplog.text


def test_licence_and_attribution_go_with_the_model(toy_corpus):
    rights = [{"licence": "CC0"}, {"licence": "CC BY 4.0", "attribution": "Anna"}, {"attribution": "Anna"}, {}]
    given = [replace(u, source=source) for u, source in zip(some(toy_corpus, 4), rights, strict=True)]
    about = describe_training(toy_corpus, given, Selection("train"), 4)
    assert about["licence"] == ["CC BY 4.0", "CC0"]
    assert about["attribution"] == ["Anna"]
    assert about["corpus"] == ["toy"]
    assert set(about["versions"]) == {"lipmotion", "numpy", "scipy"}
    assert about["minutes"] == pytest.approx(0.2, abs=0.05)


def test_nothing_usable(toy_corpus, tmp_path):
    wrong = corpus_of(tmp_path, [replace(u, words=("five",) * 100) for u in some(toy_corpus, 2)])
    with pytest.raises(CorpusError, match="none of 2 utterances has a transcript that fits"):
        train(wrong, recogniser=SMALL)


def test_other_engines_have_no_use_for_voices(toy_corpus):
    with pytest.raises(InputError, match="the engine 'joint' does not learn from other voices"):
        train(toy_corpus, engine=JOINT, voices=others())


def others() -> Iterator[SpokenSentence]:
    """Two speakers of whom nothing was seen."""
    for number, sentence in enumerate(toy_sentences(4)):
        yield SpokenSentence(sentence.name, ("bert", "anna")[number % 2], sentence.audio, sentence.units)


@pytest.mark.long
def test_voices_of_others_teach_engines_that_have_a_use_for_them(toy_corpus):
    stages: list[str] = []
    plain = {"states": 1, "asynchrony": 0, "mixtures": 1, "acoustic_regression": False, "variance_scaling": False}
    engine = engine_named("coupled", plain | {"speech_only_mixtures": 1})
    chosen = {"selection": Selection(names=TRAINED[:4]), "recogniser": SMALL, "engine": engine}
    run = Run(monitor=lambda event: stages.append(event.stage))
    model, report = train(toy_corpus, **chosen, voices=others(), run=run)
    alone, _ = train(toy_corpus, **chosen)
    assert model.about["voices"] == ["anna", "bert"]
    assert model.about["utterances"] == 4
    assert report.used == TRAINED[:4]
    assert "voices" not in alone.about
    assert {"aligning other voices", "learning motion: more speech"} <= set(stages)
    speech, lips = ([one.learned.chains.groups[group].mixtures.means for one in (model, alone)] for group in (0, 1))
    assert np.abs(speech[0] - speech[1]).max() > 0.1
    assert lips[0].tobytes() == lips[1].tobytes()


@pytest.mark.long
def test_the_training_list_is_used_and_gives_the_same_model(toy_corpus, joint_model, tmp_path):
    model, report = train(toy_corpus, recogniser=SMALL, engine=JOINT)
    for name, each in (("first", joint_model), ("again", model)):
        save_model(each, tmp_path / f"{name}.lipmotion")
    assert (tmp_path / "again.lipmotion").read_bytes() == (tmp_path / "first.lipmotion").read_bytes()
    assert (report.used, report.skipped) == (TRAINED, {})
    assert report.figures["frames"] > 1500
    assert (model.about["split"], model.about["utterances"]) == ("train", 8)


Labelled = list[tuple[Utterance, Timeline[Unit]]]


@pytest.fixture(scope="module")
def right_transcripts() -> Labelled:
    """Utterances whose transcripts are right, with their phones in time."""
    sentences = toy_sentences(12)[:3]
    return [(utterance, said.units) for utterance, said in zip(toy_utterances(12)[:3], sentences, strict=True)]


def messages(caplog: pytest.LogCaptureFixture) -> list[str]:
    assert all(record.levelno == logging.WARNING for record in caplog.records)
    return [record.getMessage() for record in caplog.records]


@pytest.mark.long
def test_training_names_the_transcripts_of_something_else_and_what_has_none(tmp_path, caplog):
    corpus = Corpus.create(tmp_path / "corpus")
    changed = {2: ("squash", "six", "fish", "chefs"), 4: None, 5: ()}
    for number, utterance in enumerate(toy_utterances(12)):
        corpus.add(replace(utterance, words=changed.get(number, utterance.words), phones=None))
    train(corpus, recogniser=SMALL, engine=engine_named("joint", {}))
    missing, wrong = (text for text in messages(caplog) if "transcript" in text)
    assert missing.startswith("2 of 8 recordings have no transcript (toy04, toy05): phones are recognised")
    assert wrong.startswith("1 of 6 transcripts seem not to be what is said (toy02), which teaches wrong lips")


def half_of(units: Timeline[Unit]) -> Timeline[Unit]:
    """Return the first phones, and silence in the place of the others."""
    return Timeline((*units[:3], Span(units[3].start_s, units[-1].end_s, Unit("sil"))))


def test_words_that_are_left_out(right_transcripts, caplog):
    """Half of the sentence stands as silence; right transcripts are not named."""
    labels.warn_of_doubtful_transcripts(right_transcripts)
    labels.warn_of_missing_transcripts([utterance for utterance, _ in right_transcripts])
    assert not caplog.records
    utterance, units = right_transcripts[0]
    labels.warn_of_doubtful_transcripts([(utterance, half_of(units))])
    (text,) = messages(caplog)
    assert text.startswith("1 of 1 transcripts seem to leave out words that are said (toy0")


def test_labelled_phones_are_believed_and_of_two_alignments_the_better_one_counts(right_transcripts, caplog):
    """Of phones in half of their places, and of others in all of them: these cover more of the speech and fit worse."""
    (utterance, units), (_, others) = right_transcripts[:2]
    labels.warn_of_doubtful_transcripts([(replace(utterance, phones=units), others)])
    assert not caplog.records
    for one, other in ((half_of(units), others), (half_of(units), half_of(units)), (half_of(units), units)):
        labels.warn_of_doubtful_transcripts([(utterance, one)], lambda _, other=other: other)
    assert ["leave out words" in text for text in messages(caplog)] == [True, True]


def test_without_general_models_nothing_is_measured(right_transcripts, caplog, monkeypatch):
    monkeypatch.setitem(sys.modules, "pocketsphinx", None)
    load_general.cache_clear()
    labels.warn_of_doubtful_transcripts([(right_transcripts[0][0], right_transcripts[1][1])])
    assert not caplog.records


@pytest.fixture(scope="module")
def utterances() -> list[Utterance]:
    return toy_utterances(12)[:4]


@pytest.fixture(scope="module")
def space(utterances: list[Utterance]) -> Eigenlips:
    return train_eigenlips(utterances, 4)


@pytest.fixture(scope="module")
def models(toy_corpus: Corpus, pictured_model_file: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A model of the pictures, and one of pictures and points, as they are saved."""
    path = tmp_path_factory.mktemp("visual") / "eigenlips"
    save_model(quickly(toy_corpus, visual="eigenlips", articulation=False), path)
    return {"eigenlips": path, "both": pictured_model_file}


def crops(given: Sequence[Utterance]) -> list[np.ndarray]:
    return [np.asarray(utterance.track.crops) for utterance in given]


def test_pictures_are_taken_evenly_from_the_frames_that_are_seen(utterances):
    """Those that are not seen are white here: not one of them is taken."""
    given, kept = [], []
    for number, utterance in enumerate(utterances):
        seen = np.arange(len(utterance.track.seen)) % 3 != number % 3
        pictures = np.where(seen[:, None, None, None], utterance.track.crops, 255).astype(np.uint8)
        given.append(replace(utterance, track=replace(utterance.track, crops=pictures, seen=seen)))
        kept.append(pictures[seen])
    everything = np.concatenate(kept)
    frames = ((np.arange(50) + 0.5) * len(everything) / 50).astype(int)
    assert np.array_equal(train_eigenlips(given, 4, 50).basis, fit_eigenlips(everything[frames], 4).basis)


def test_an_utterance_that_was_never_seen_gives_no_picture(utterances):
    track = utterances[1].track
    hidden = replace(utterances[1], track=replace(track, seen=np.zeros_like(track.seen)))
    some = train_eigenlips([utterances[0], hidden, utterances[2]], 3)
    assert np.array_equal(some.basis, train_eigenlips([utterances[0], utterances[2]], 3).basis)
    with pytest.raises(CorpusError, match="no face is seen in 1 utterances; prepare a corpus of videos with faces"):
        train_eigenlips([hidden])


def test_motion_has_the_channels_that_are_learned(utterances, space):
    one = utterances[0]
    assert with_visual_channels(one, "geometry", None) is one
    pictured, both = (with_visual_channels(one, visual, space).track.motion for visual in ("eigenlips", "both"))
    assert pictured.channels == space.channels
    assert np.array_equal(pictured.values, space.project(crops([one])[0]))
    assert both.channels == (*one.track.motion.channels, *space.channels)
    assert np.array_equal(both.values, np.concatenate([one.track.motion.values, pictured.values], axis=1))
    assert pictured.rate_hz == both.rate_hz == one.track.motion.rate_hz


def test_what_is_missing_is_reported(utterances, space, tmp_path):
    blind = replace(utterances[0], track=replace(utterances[0].track, crops=None))
    words = f"{blind.name}: no mouth pictures, which eigenlips need; prepare its video again without --no-crops"
    with pytest.raises(CorpusError, match=words):
        train_eigenlips([utterances[1], blind])
    with pytest.raises(CorpusError, match=words):
        with_visual_channels(blind, "both", space)
    with pytest.raises(InputError, match="visual 'both' without eigenlips"):
        with_visual_channels(utterances[0], "both", None)
    with pytest.raises(InputError, match="visual is 'pixels', required one of: geometry, eigenlips, both"):
        with_visual_channels(utterances[0], "pixels", None)
    corpus = Corpus.create(tmp_path / "corpus")
    corpus.add(blind)
    with pytest.raises(CorpusError, match=words):
        train(corpus, visual="eigenlips")
    with pytest.raises(InputError, match="visual is 'lips'"):
        train(corpus, visual="lips")


@pytest.mark.long
def test_a_model_of_pictures_draws_mouths_it_has_not_seen(models, toy_corpus):
    """Saved, loaded, and asked for the mouth of a sentence of the test list."""
    model = load_model(models["eigenlips"])
    held_out = toy_corpus.utterance(toy_corpus.names("test")[0])
    motion = animate(held_out.audio, transcript=" ".join(held_out.words or ()), model=model).motion
    assert motion.channels == model.eigenlips.channels
    times_s = np.arange(len(held_out.track.seen)) / held_out.track.motion.rate_hz
    drawn = model.eigenlips.restore(motion.at(times_s)).astype(float)
    real = crops([held_out])[0].astype(float)
    still = np.abs(real - model.eigenlips.mean.T.reshape(56, 72, 3)).mean()
    assert np.abs(drawn - real).mean() < 0.5 * still


@pytest.mark.long
def test_figures_of_both(models, toy_model, toy_corpus):
    """The eigenlips stand apart: figures of the lip distances are of these alone."""
    both = load_model(models["both"])
    figures, plain = (evaluate(model, toy_corpus, recogniser="own") for model in (both, toy_model))
    assert figures["closed_under"] == plain["closed_under"]
    for name, condition in figures["conditions"].items():
        assert set(condition) == set(plain["conditions"][name]) | {"eigenlips"}
        assert list(condition["channels"]) == ["opening", "width", "outer"]
        assert condition["acc"] == pytest.approx(np.mean([row["acc"] for row in condition["channels"].values()]))
        assert condition["acc"] > 0.8
        assert condition["amse"] < 0.1  # eye distances
        assert condition["eigenlips"]["amse"] > 10  # grey levels
        assert condition["leading"] == "opening"
    assert "AMSE of the eigenlips" in format_figures(figures)
    held_out = load_held_out(toy_corpus, recogniser_of(both), visual=both.visual, eigenlips=both.eigenlips)
    assert held_out.channels == ("opening", "width", "outer", *(channel.name for channel in both.eigenlips.channels))
    made = generate_clips(held_out, "with transcript", both.engine, both.learned)
    for clip, name in zip(made, toy_corpus.names("test"), strict=True):
        images = crops([toy_corpus.utterance(name)])[0]
        assert np.array_equal(clip.original[:, 3:], both.eigenlips.project(images))  # the projected pictures
