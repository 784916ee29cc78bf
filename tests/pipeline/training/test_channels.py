from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion import Corpus, Selection, animate, evaluate, load_model, read_motion, save_model, train, write
from lipmotion.engines import engine_named
from lipmotion.errors import CorpusError, ExportError, InputError
from lipmotion.measures.evaluation_table import figures_table
from lipmotion.motion import posterior_network
from lipmotion.motion.eigenlips import Eigenlips, fit_eigenlips
from lipmotion.pipeline.model import BOTH, EIGENLIPS, GEOMETRY
from lipmotion.pipeline.training.channels import train_eigenlips, with_visual_channels
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.types import Utterance
from lipmotion_lab.evaluation.held_out import generate_clips, load_held_out
from testing.toy import SMALL, toy_utterances

ENGINE = engine_named("trajectory", {"articulation": False})


@pytest.fixture(scope="module")
def utterances() -> list[Utterance]:
    return toy_utterances(12)[:4]


@pytest.fixture(scope="module")
def space(utterances: list[Utterance]) -> Eigenlips:
    return train_eigenlips(utterances, 4)


@pytest.fixture(scope="module")
def models(toy_corpus: Corpus, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A model of the pictures, and one of pictures and points, as they are saved."""
    folder = tmp_path_factory.mktemp("visual")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(posterior_network, "STEPS", 25.0)  # pictures do not follow as simply as the toy's channels
        for visual in (EIGENLIPS, BOTH):
            save_model(train(toy_corpus, recogniser=SMALL, engine=ENGINE, visual=visual)[0], folder / visual)
    return {visual: folder / visual for visual in (EIGENLIPS, BOTH)}


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
    hidden = replace(
        utterances[1], track=replace(utterances[1].track, seen=np.zeros(len(utterances[1].track.seen), bool))
    )
    some = train_eigenlips([utterances[0], hidden, utterances[2]], 3)
    assert np.array_equal(some.basis, train_eigenlips([utterances[0], utterances[2]], 3).basis)
    with pytest.raises(CorpusError, match="no face is seen in 1 utterances; prepare a corpus of videos with faces"):
        train_eigenlips([hidden])


def test_motion_has_the_channels_that_are_learned(utterances, space):
    one = utterances[0]
    assert with_visual_channels(one, GEOMETRY, None) is one
    pictured, both = (with_visual_channels(one, visual, space).track.motion for visual in (EIGENLIPS, BOTH))
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
        with_visual_channels(blind, BOTH, space)
    with pytest.raises(InputError, match="visual 'both' without eigenlips"):
        with_visual_channels(utterances[0], BOTH, None)
    with pytest.raises(InputError, match="visual is 'pixels', required one of: geometry, eigenlips, both"):
        with_visual_channels(utterances[0], "pixels", None)
    corpus = Corpus.create(tmp_path / "corpus")
    corpus.add(blind)
    with pytest.raises(CorpusError, match=words):
        train(corpus, visual=EIGENLIPS)
    with pytest.raises(InputError, match="visual is 'lips'"):
        train(corpus, visual="lips")


@pytest.mark.long
def test_a_model_of_pictures_draws_mouths_it_has_not_seen(models, toy_corpus):
    """Saved, loaded, and asked for the mouth of a sentence of the test list."""
    model = load_model(models[EIGENLIPS])
    held_out = toy_corpus.utterance(toy_corpus.names("test")[0])
    motion = animate(held_out.audio, transcript=" ".join(held_out.words or ()), model=model).motion
    assert motion.channels == model.eigenlips.channels
    times_s = np.arange(len(held_out.track.seen)) / held_out.track.motion.rate_hz
    drawn = model.eigenlips.restore(motion.at(times_s)).astype(float)
    real = crops([held_out])[0].astype(float)
    still = np.abs(real - model.eigenlips.mean.T.reshape(56, 72, 3)).mean()
    assert np.abs(drawn - real).mean() < 0.5 * still


def test_figures_of_pictures(models, toy_corpus):
    figures = evaluate(load_model(models[EIGENLIPS]), toy_corpus, recogniser="own")
    assert figures["closed_under"] is None
    for condition in figures["conditions"].values():
        lips = condition["eigenlips"]
        assert list(condition) == ["channels", "acc", "amse", "leading", "lag_ms", "eigenlips"]
        assert condition["channels"] == {}
        assert len(lips["channels"]) == 90
        assert lips["acc"] == pytest.approx(np.mean([row["acc"] for row in lips["channels"].values()]))
        assert (condition["acc"], condition["amse"]) == (lips["acc"], lips["amse"])
        assert lips["channels"]["lips_r_01"]["acc"] > 0.85
        assert condition["leading"] in lips["channels"]
    assert "90 eigenlips" in figures_table(figures)
    assert "lips_r_01 " not in figures_table(figures).replace("lag of lips_r_01 ", "")


def test_figures_of_both(models, toy_model, toy_corpus):
    """The eigenlips stand apart: figures of the lip distances are of these alone."""
    figures, plain = (evaluate(model, toy_corpus, recogniser="own") for model in (load_model(models[BOTH]), toy_model))
    assert figures["closed_under"] == plain["closed_under"]
    for name, condition in figures["conditions"].items():
        assert set(condition) == set(plain["conditions"][name]) | {"eigenlips"}
        assert list(condition["channels"]) == ["opening", "width", "outer"]
        assert condition["acc"] == pytest.approx(np.mean([row["acc"] for row in condition["channels"].values()]))
        assert condition["acc"] > 0.8
        assert condition["amse"] < 0.1  # eye distances
        assert condition["eigenlips"]["amse"] > 10  # grey levels
        assert condition["leading"] == "opening"
    assert "AMSE of the eigenlips" in figures_table(figures)


def test_originals_are_the_projected_pictures(models, toy_corpus):
    model = load_model(models[BOTH])
    found = load_held_out(toy_corpus, Recogniser(model.phones, "own"), visual=model.visual, eigenlips=model.eigenlips)
    assert found.channels == ("opening", "width", "outer", *(channel.name for channel in model.eigenlips.channels))
    made = generate_clips(found, "with transcript", model.engine, model.learned)
    for clip, name in zip(made, toy_corpus.names("test"), strict=True):
        images = crops([toy_corpus.utterance(name)])[0]
        assert np.array_equal(clip.original[:, 3:], model.eigenlips.project(images))


@pytest.mark.long
def test_the_joint_engine_learns_pictures_too(toy_corpus):
    engine = engine_named("joint", {})
    model, _ = train(
        toy_corpus,
        selection=Selection(names=toy_corpus.names("train")[:4]),
        recogniser=SMALL,
        engine=engine,
        visual=EIGENLIPS,
    )
    assert (
        evaluate(model, toy_corpus)["conditions"]["with transcript"]["eigenlips"]["channels"]["lips_r_01"]["acc"] > 0.5
    )


def test_motion_files_hold_the_coefficients_and_videos_need_an_opening(models, toy_speech, tmp_path):
    result = animate(toy_speech, model=models[EIGENLIPS])
    write(result, [tmp_path / "a.npz", tmp_path / "a.json"])
    for name in ("a.npz", "a.json"):
        assert read_motion(tmp_path / name)[0].channels == result.motion.channels
    with pytest.raises(ExportError, match="no channel 'opening' to draw a face from"):
        write(result, tmp_path / "a.mp4", speech=toy_speech)
