import logging
from dataclasses import replace

import numpy as np
import pytest

from lipmotion import (
    Corpus,
    Edits,
    Model,
    Request,
    Selection,
    Session,
    animate,
    evaluate,
    explain,
    load_model,
    save_model,
    train,
)
from lipmotion.engines import engine_named
from lipmotion.errors import CorpusError, InputError
from lipmotion.motion.closure import find_closable_ranges
from lipmotion.motion.speaker_maps import speakers_to_arrays
from lipmotion.pipeline.generate.explain import chain_posteriors
from lipmotion.types import Channel, Constraints, Motion, Pin, ReducedVariance, Utterance
from pipeline import made
from pipeline.made import GAIN, OFFSET, corpus_of
from testing.toy import SMALL, ToySentence, toy_utterances


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    return corpus_of(tmp_path_factory.mktemp("people") / "corpus", made.people())


@pytest.fixture(scope="module")
def model(people: Corpus) -> Model:
    return train(people, recogniser=SMALL)[0]


def request(sentence: ToySentence, speaker: str = "") -> Request:
    return Request(sentence.audio, units=sentence.units, speaker=speaker, pauses="natural")


def opening(model: Model, sentence: ToySentence, speaker: str = "") -> np.ndarray:
    return animate(request(sentence, speaker), model=model).motion["opening"]


@pytest.mark.long
def test_each_person_moves_as_far_as_they_do(model, toy_sentence):
    assert model.speakers.names == ("anna", "ben")
    assert model.about["speakers"] == ["anna", "ben"]
    anna, ben, mean = (opening(model, toy_sentence, name) for name in ("anna", "ben", ""))
    assert anna.max() > mean.max() > ben.max()
    assert np.ptp(ben) / np.ptp(anna) == pytest.approx(GAIN[0], abs=0.15)
    assert np.corrcoef(anna, ben)[0, 1] > 0.97


def test_lips_close_in_p_b_m_as_far_as_each_person_closes_them(model, toy_sentence):
    ranges = find_closable_ranges(toy_sentence.units, len(opening(model, toy_sentence)))
    assert ranges
    for name, closed in (("anna", 0.0), ("ben", OFFSET[0])):
        curve = opening(model, toy_sentence, name)
        for frames in ranges:
            assert curve[frames].min() < closed + 0.012


def test_variances_are_in_the_units_of_the_person(model, toy_sentence):
    mean, ben = (animate(request(toy_sentence, name), model=model) for name in ("", "ben"))
    np.testing.assert_allclose(ben.variance, mean.variance * np.square(model.speakers.of("ben").gain))


def test_variances_of_long_recordings(model, toy_sentence, monkeypatch):
    exact = animate(request(toy_sentence, "ben"), model=model)
    monkeypatch.setattr("lipmotion.motion.generation.DOUBLE_FRAMES", 10)
    single = animate(request(toy_sentence, "ben"), model=model)
    assert isinstance(single.spread, ReducedVariance)
    assert isinstance(exact.spread, ReducedVariance)  # passages are short, and silence between them lasts for hours
    assert single.motion.values.dtype == np.float32
    np.testing.assert_allclose(single.variance, exact.variance, rtol=1e-4)
    np.testing.assert_allclose(single.motion.values, exact.motion.values, atol=1e-5)


def test_pins_hold_in_the_units_of_the_person(model, toy_sentence):
    pins = (Pin(0.1, "opening", 0.0), Pin(0.9, "opening", 0.17), Pin(0.93, "opening", 0.0), Pin(1.2, "width", 0.5))
    for speaker in ("anna", "ben"):
        motion = animate(request(toy_sentence, speaker), model=model, constraints=Constraints(pins)).motion
        for pin in pins:
            assert motion[pin.channel][round(pin.time_s * 100)] == pytest.approx(pin.value, abs=1e-9)
        assert motion["opening"].min() >= 0
    below = Constraints((Pin(0.5, "opening", -0.01),))
    with pytest.raises(InputError, match=r"-0\.01, required at least 0"):
        animate(request(toy_sentence, "ben"), model=model, constraints=below)


def test_unknown_speakers_are_refused(model, toy_model, toy_sentence):
    with pytest.raises(InputError, match="no speaker 'cleo', only: anna, ben"):
        opening(model, toy_sentence, "cleo")
    with pytest.raises(InputError, match=r"tells no speakers apart.*'cleo'"):
        opening(toy_model, toy_sentence, "cleo")
    assert toy_model.speakers is None


def test_maps_are_in_the_model_file(model, toy_sentence, tmp_path):
    save_model(model, tmp_path / "people.lipmotion")
    again = load_model(tmp_path / "people.lipmotion")
    for name in ("anna", "ben"):
        np.testing.assert_allclose(opening(again, toy_sentence, name), opening(model, toy_sentence, name), atol=1e-4)


def test_maps_of_other_channels_are_refused(model, toy_sentence, tmp_path, monkeypatch):
    def of_jaw(maps: object) -> dict[str, np.ndarray]:
        arrays = speakers_to_arrays(maps)
        arrays["channels"] = np.array([("opening", "eye_distance"), ("width", "eye_distance"), ("jaw", "weight")])
        return arrays

    monkeypatch.setattr("lipmotion.pipeline.model.speakers_to_arrays", of_jaw)
    save_model(model, tmp_path / "jaw.lipmotion")
    again = load_model(tmp_path / "jaw.lipmotion")
    with pytest.raises(InputError, match="'outer'"):
        opening(again, toy_sentence, "ben")


def test_evaluation_compares_each_with_their_own_motion(people, model):
    own, mean = (
        evaluate(each, people, selection=Selection("test"), recogniser="own")
        for each in (model, replace(model, speakers=None))
    )
    condition = "with transcript"
    assert own["conditions"][condition]["amse"] < 0.8 * mean["conditions"][condition]["amse"]
    assert own["strangers"] == []
    assert "strangers" not in mean


def test_strangers_are_named_and_get_the_mean_person(people, model, tmp_path):
    cleo = replace(people.utterance(people.names("test")[0]), speaker="cleo")
    corpus = corpus_of(tmp_path / "cleo", [cleo])
    figures = evaluate(model, corpus, selection=Selection(None), recogniser="own")
    assert figures["strangers"] == ["cleo"]
    mean = evaluate(replace(model, speakers=None), corpus, selection=Selection(None), recogniser="own")
    assert figures["conditions"] == mean["conditions"]


def test_an_explanation_is_in_the_units_of_the_person(model, toy_sentence):
    motion = animate(request(toy_sentence, "ben"), model=model).motion
    for explanation in explain(request(toy_sentence, "ben"), at=[0.0, 0.9], model=model):
        for name, value in explanation.motion.items():
            assert value.value == pytest.approx(motion[name][explanation.frame], abs=1e-9)


def test_one_person_is_not_mapped(people):
    model, _ = train(
        people, selection=Selection("train", ("anna",)), recogniser=SMALL, engine=engine_named("joint", {})
    )
    assert model.speakers is None


@pytest.mark.long
@pytest.mark.parametrize("engine", ["joint", "coupled"])
def test_other_engines(people, toy_sentence, engine):
    settings = {"chains": "sVis 2vis", "mixtures": 2} if engine == "coupled" else {}
    model, _ = train(people, recogniser=SMALL, engine=engine_named(engine, settings))
    anna, ben = (opening(model, toy_sentence, name) for name in ("anna", "ben"))
    assert np.ptp(ben) / np.ptp(anna) == pytest.approx(GAIN[0], abs=0.15)
    pins = Constraints((Pin(0.9, "opening", 0.01),))
    pinned = animate(request(toy_sentence, "ben"), model=model, constraints=pins).motion
    assert pinned["opening"][90] == pytest.approx(0.01, abs=1e-9)
    (explanation,) = explain(request(toy_sentence, "ben"), at=0.9, model=model)
    assert explanation.motion["opening"].value == pytest.approx(ben[90], abs=1e-9)
    if engine == "coupled":
        generation, _ = chain_posteriors(Session(request(toy_sentence, "ben"), model=model), Edits())
        np.testing.assert_allclose(generation.motion["opening"], ben, atol=1e-12)


def captured(utterance: Utterance, channels: tuple[Channel, ...]) -> Utterance:
    motion = utterance.track.motion
    motion = Motion(motion.values[:, : len(channels)], motion.rate_hz, channels)
    return replace(utterance, track=replace(utterance.track, motion=motion), speaker="captured")


@pytest.mark.long
def test_channels_that_all_have_are_trained_on(people, tmp_path, caplog):
    footage = [people.utterance(name) for name in people.names("train")[:6]]
    jaw = (Channel("jaw", "weight"), Channel("width"), Channel("opening"))
    capture = [captured(utterance, jaw) for utterance in toy_utterances(6, seed=1)[:3]]
    capture = [replace(utterance, name=f"capture-{utterance.name}") for utterance in capture]
    corpus = corpus_of(tmp_path / "mixed", [*footage, *capture])
    with caplog.at_level(logging.WARNING):
        model, report = train(corpus, recogniser=SMALL)
    assert "training on the 2 channels that all have (width, opening); left out: jaw, outer" in caplog.text
    assert len(report.used) == 9
    assert model.speakers.names == ("anna", "ben", "captured")
    generated = animate(Request(toy_utterances(3)[0].audio, speaker="captured", recogniser="own"), model=model)
    assert generated.motion.names == ("width", "opening")


def test_no_common_channel_is_an_error(people, tmp_path):
    weights = tuple(Channel(name, "weight") for name in ("opening", "jaw"))
    strange = [captured(utterance, weights) for utterance in toy_utterances(3)[:1]]
    corpus = corpus_of(tmp_path / "apart", [people.utterance(people.names("train")[1]), *strange])
    with pytest.raises(CorpusError, match=r"2 kinds of motion without a common channel: .*opening, jaw.*--speaker"):
        train(corpus, recogniser=SMALL)
