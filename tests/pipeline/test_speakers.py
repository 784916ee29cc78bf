import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion import (
    Corpus,
    Model,
    Request,
    Selection,
    animate,
    evaluate,
    explain,
    load_model,
    map_onto,
    save_model,
    train,
    with_person,
)
from lipmotion.engines import engine_named
from lipmotion.errors import CorpusError, InputError
from lipmotion.motion.closure import find_closable_ranges
from lipmotion.pipeline.request import Onto
from lipmotion.types import Channel, Constraints, Motion, Pin, Track, Utterance
from lipmotion_faces.tracking.frames import VideoSpan
from pipeline import made
from pipeline.made import GAIN, OFFSET, corpus_of, of_ben, people
from robustness.case import changed_model, npy
from testing.toy import SMALL, ToySentence, toy_motion, toy_utterances

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def two_people(tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    return corpus_of(tmp_path_factory.mktemp("people") / "corpus", made.people())


@pytest.fixture(scope="module")
def model(two_people: Corpus) -> Model:
    return train(two_people, recogniser=SMALL)[0]


def request(sentence: ToySentence, speaker: str = "", onto: Onto | None = None, **more: str) -> Request:
    return Request(sentence.audio, units=sentence.units, speaker=speaker, onto=onto, pauses="natural", **more)


def opening(model: Model, sentence: ToySentence, speaker: str = "") -> np.ndarray:
    return animate(request(sentence, speaker), model=model).motion["opening"]


def test_lips_close_in_p_b_m_as_far_as_each_person_closes_them(model, toy_sentence):
    ranges = find_closable_ranges(toy_sentence.units, len(opening(model, toy_sentence)))
    assert ranges
    for name, closed in (("anna", 0.0), ("ben", OFFSET[0])):
        curve = opening(model, toy_sentence, name)
        for frames in ranges:
            assert curve[frames].min() < closed + 0.012


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
    with pytest.raises(InputError, match="no speaker 'cleo', required one of: anna, ben"):
        opening(model, toy_sentence, "cleo")
    with pytest.raises(InputError, match=r"tells no speakers apart.*'cleo'"):
        opening(toy_model, toy_sentence, "cleo")
    assert toy_model.speakers is None


def test_maps_of_other_channels_are_refused(model, toy_sentence, tmp_path):
    save_model(model, tmp_path / "people.lipmotion")
    channels = npy(np.array([("opening", "eye_distance"), ("width", "eye_distance"), ("jaw", "weight")]))
    changes = {"speakers/channels.npy": channels}
    again = load_model(changed_model(tmp_path / "people.lipmotion", tmp_path / "jaw.lipmotion", changes))
    with pytest.raises(InputError, match="'outer'"):
        opening(again, toy_sentence, "ben")


def test_evaluation_compares_each_with_their_own_motion(two_people, model):
    own, mean = (
        evaluate(each, two_people, selection=Selection("test"), recogniser="own")
        for each in (model, replace(model, speakers=None))
    )
    condition = "with transcript"
    assert own["conditions"][condition]["amse"] < 0.8 * mean["conditions"][condition]["amse"]
    assert own["strangers"] == []
    assert "strangers" not in mean


def test_strangers_are_named_and_get_the_mean_person(two_people, model, tmp_path):
    cleo = replace(two_people.utterance(two_people.names("test")[0]), speaker="cleo")
    corpus = corpus_of(tmp_path / "cleo", [cleo])
    figures = evaluate(model, corpus, selection=Selection(None), recogniser="own")
    assert figures["strangers"] == ["cleo"]
    mean = evaluate(replace(model, speakers=None), corpus, selection=Selection(None), recogniser="own")
    assert figures["conditions"] == mean["conditions"]


def test_one_person_is_not_mapped(two_people):
    anna = Selection("train", ("anna",))
    assert train(two_people, selection=anna, recogniser=SMALL, engine=engine_named("joint", {}))[0].speakers is None


@pytest.mark.parametrize("engine", ["joint", "coupled"])
def test_other_engines(two_people, toy_sentence, engine):
    settings = {"chains": "sVis 2vis", "mixtures": 2} if engine == "coupled" else {}
    model, _ = train(two_people, recogniser=SMALL, engine=engine_named(engine, settings))
    anna, ben = (opening(model, toy_sentence, name) for name in ("anna", "ben"))
    assert np.ptp(ben) / np.ptp(anna) == pytest.approx(GAIN[0], abs=0.15)
    pins = Constraints((Pin(0.9, "opening", 0.01),))
    pinned = animate(request(toy_sentence, "ben"), model=model, constraints=pins).motion
    assert pinned["opening"][90] == pytest.approx(0.01, abs=1e-9)
    (explanation,) = explain(request(toy_sentence, "ben"), at=0.9, model=model)
    assert explanation.motion["opening"].value == pytest.approx(ben[90], abs=1e-9)


def captured(utterance: Utterance, channels: tuple[Channel, ...]) -> Utterance:
    motion = utterance.track.motion
    motion = Motion(motion.values[:, : len(channels)], motion.rate_hz, channels)
    return replace(utterance, track=replace(utterance.track, motion=motion), speaker="captured")


def test_channels_that_all_have_are_trained_on(two_people, tmp_path, caplog):
    footage = [two_people.utterance(name) for name in two_people.names("train")[:6]]
    jaw = (Channel("jaw", "weight"), Channel("width"), Channel("opening"))
    capture = [captured(utterance, jaw) for utterance in toy_utterances(6, seed=1)[:3]]
    capture = [replace(utterance, name=f"capture-{utterance.name}") for utterance in capture]
    corpus = corpus_of(tmp_path / "mixed", [*footage, *capture])
    with caplog.at_level(logging.WARNING):
        model, report = train(corpus, recogniser=SMALL)
    assert "training on the 2 channels that all have (width, opening); left out: jaw, outer" in caplog.text
    assert len(report.used) == 9
    assert [*model.speakers] == ["anna", "ben", "captured"]
    generated = animate(Request(toy_utterances(3)[0].audio, speaker="captured", recogniser="own"), model=model)
    assert generated.motion.names == ("width", "opening")
    weights = tuple(Channel(name, "weight") for name in ("opening", "jaw"))
    strange = [captured(utterance, weights) for utterance in toy_utterances(3)[:1]]
    corpus = corpus_of(tmp_path / "apart", [two_people.utterance(two_people.names("train")[1]), *strange])
    with pytest.raises(CorpusError, match=r"2 kinds of motion without a common channel: .*opening, jaw.*--speaker"):
        train(corpus, recogniser=SMALL)


@pytest.fixture(scope="module")
def ben(tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    return corpus_of(tmp_path_factory.mktemp("ben") / "corpus", [of_ben(each) for each in toy_utterances(8, seed=1)])


@pytest.fixture(scope="module")
def of_two(tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    return corpus_of(tmp_path_factory.mktemp("two") / "corpus", people(seed=1))


@pytest.fixture(scope="module")
def two_model(of_two: Corpus) -> Model:
    return train(of_two, recogniser=SMALL, engine=engine_named("trajectory", {"articulation": False}))[0]


def test_variance_and_pins_and_explanations_are_of_the_person(toy_model, toy_sentence, ben):
    person = map_onto(toy_model, ben)
    own, mapped = (animate(request(toy_sentence, onto=onto), model=toy_model) for onto in (None, person))
    np.testing.assert_allclose(mapped.variance, own.variance * np.square(person.gain))
    pins = Constraints((Pin(0.9, "opening", 0.17), Pin(1.2, "width", 0.5)))
    pinned = animate(request(toy_sentence, onto=person), model=toy_model, constraints=pins).motion
    for pin in pins.pins:
        assert pinned[pin.channel][round(pin.time_s * 100)] == pytest.approx(pin.value, abs=1e-9)
    (explanation,) = explain(request(toy_sentence, onto=person), at=0.9, model=toy_model)
    assert explanation.motion["opening"].value == pytest.approx(mapped.motion["opening"][90], abs=1e-9)


def test_a_person_of_the_model_onto_another(two_model, toy_sentence, ben):
    """Whoever of the model's people speaks, the motion is in ben's place and range."""
    requests = [request(toy_sentence, name, ben) for name in ("", "anna", "ben")]
    people = [animate(each, model=two_model).motion for each in requests]
    ranges = np.stack([np.ptp(np.percentile(motion.values, [5, 95], axis=0), axis=0) for motion in people])
    np.testing.assert_allclose(ranges / ranges[2], 1, atol=0.15)
    anna = animate(request(toy_sentence, "anna"), model=two_model).motion
    assert np.ptp(anna["opening"]) > 1.3 * np.ptp(people[1]["opening"])
    with pytest.raises(InputError, match="no speaker 'cleo', required one of: anna, ben"):
        animate(request(toy_sentence, "cleo", ben), model=two_model)


def test_onto_one_person_of_a_corpus_of_several(toy_model, toy_sentence, of_two):
    """The motion is that of the model, in ben's place and range."""
    like_ben = request(toy_sentence, onto=of_two, onto_speaker="ben")
    own, mapped = (animate(each, model=toy_model).motion for each in (request(toy_sentence), like_ben))
    wanted = OFFSET + GAIN * toy_motion(toy_sentence.units, 100.0).values
    ranges = [np.ptp(np.percentile(values, [2, 98], axis=0), axis=0) for values in (mapped.values, wanted)]
    np.testing.assert_allclose(ranges[0] / ranges[1], 1, atol=0.3)
    assert np.abs(np.median(mapped.values, axis=0) - np.median(wanted, axis=0)).max() < 0.03
    for name in own.names:
        assert np.corrcoef(own[name], mapped[name])[0, 1] > 0.98
    for frames in find_closable_ranges(toy_sentence.units, len(mapped.values)):
        assert mapped["opening"][frames].min() == pytest.approx(OFFSET[0], abs=0.02)
    for more, found in (({}, "2 speakers"), ({"onto_speaker": "cleo"}, "no speaker 'cleo'")):
        with pytest.raises(InputError, match=rf"{found}, required one of: anna, ben; name it \(--onto-speaker\)"):
            animate(request(toy_sentence, onto=of_two, **more), model=toy_model)


def test_onto_a_person_of_another_model(toy_model, two_model, toy_sentence, tmp_path):
    save_model(two_model, tmp_path / "two.lipmotion")
    mapped = animate(request(toy_sentence, onto=tmp_path / "two.lipmotion", onto_speaker="ben"), model=toy_model).motion
    wanted = animate(request(toy_sentence, "ben"), model=two_model).motion
    own = animate(request(toy_sentence), model=toy_model).motion
    assert np.abs(mapped.values - wanted.values).mean() < 0.4 * np.abs(own.values - wanted.values).mean()
    with pytest.raises(InputError, match="no speaker 'cleo', required one of: anna, ben"):
        animate(request(toy_sentence, onto=two_model, onto_speaker="cleo"), model=toy_model)
    with pytest.raises(InputError, match=r"measured in some speech; give a request \(speech=\.\.\.\)"):
        map_onto(toy_model, two_model)


def test_onto_the_person_of_a_video(toy_model, toy_sentence, toy_speech, monkeypatch):
    """The video is as short as a sentence, so that the gain counts in part."""
    tracked = []

    def track(path: Path, *, crops: bool, span: VideoSpan) -> Track:
        tracked.append((path, crops, span.end_s))
        return of_ben(toy_utterances(3)[0]).track

    monkeypatch.setattr("lipmotion_faces.transfer.track", track)
    own, mapped = (animate(request(toy_sentence, onto=onto), model=toy_model).motion for onto in (None, toy_speech))
    assert tracked == [(toy_speech, False, 60.0)]
    ratio = np.ptp(mapped["opening"]) / np.ptp(own["opening"])
    assert GAIN[0] < ratio < 0.95
    assert mapped["width"].mean() == pytest.approx(OFFSET[1] + GAIN[1] * own["width"].mean(), abs=0.03)
    with pytest.raises(InputError, match="a video has no speaker 'ben' by name"):
        map_onto(toy_model, toy_speech, onto_speaker="ben")


def test_a_map_is_kept_in_a_model(toy_model, toy_sentence, ben, tmp_path):
    person = map_onto(toy_model, ben)
    known = with_person(with_person(toy_model, "ben", person), "cleo", replace(person, gain=2 * person.gain))
    save_model(known, tmp_path / "known.lipmotion")
    again = load_model(tmp_path / "known.lipmotion")
    assert again.about["speakers"] == ["ben", "cleo"]
    wanted = animate(request(toy_sentence, onto=person), model=toy_model).motion
    found = animate(request(toy_sentence, "ben"), model=again).motion
    np.testing.assert_allclose(found.values, wanted.values, atol=1e-3)
    first, second = (animate(request(toy_sentence), model=each).motion.values for each in (toy_model, again))
    np.testing.assert_allclose(second, first, atol=1e-3)
    for name in ("ben", ""):
        with pytest.raises(InputError, match="required another name than: , ben, cleo"):
            with_person(known, name, person)
