from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from lipmotion import engines, errors, types
from lipmotion.hmm.multistream.densities import StreamWeights
from lipmotion.testing import example, examples, speech, timeline
from lipmotion.units import UNIT_SETS

SOUND = speech(timeline(("t", "aa", "p", "iy", "m", "uw", "s", "aa")))
OTHER_WORDS = timeline(("s", "uw", "t", "uw", "iy", "t", "aa", "s"))
E_VIS = UNIT_SETS["eVis"]


@cache
def trained(units: str) -> Any:
    return engine(units).fit(examples(8), types.silent_monitor).model


def engine(units: str = "eVis", recognises: bool = True, **options: object) -> Any:
    return engines.engine_named("joint", {"units": units, "recognise_units": recognises, "mixtures": 1} | options)


def generated(spoken: types.Speech, units: str = "eVis", **options: object) -> types.Generation:
    return engine(units, **options).generate(trained(units), spoken)


def recognised(units: str = "eVis", **options: object) -> types.Generation:
    """What it makes of sound alone: the phones of another recogniser, which it does not ask."""
    return generated(replace(SOUND, units=OTHER_WORDS, units_known=False), units, **options)


def spans(units: types.Timeline[types.Unit]) -> list[tuple[float, float, str]]:
    return [(span.start_s, span.end_s, span.label.phone) for span in units]


def test_other_words_of_the_same_sound_move_the_lips_otherwise() -> None:
    one, other = (generated(replace(SOUND, units=units)) for units in (SOUND.units, OTHER_WORDS))
    assert np.abs(one.motion["opening"] - other.motion["opening"]).max() > 0.1
    assert (spans(one.units), spans(other.units)) == (spans(SOUND.units), spans(OTHER_WORDS))


def test_words_that_are_known_are_not_recognised() -> None:
    own, shared = (generated(SOUND, recognises=recognises) for recognises in (True, False))
    assert own.motion.values == pytest.approx(shared.motion.values, abs=1e-9)
    assert own.units == shared.units


def test_recognised_units_are_units_and_no_phones() -> None:
    said = [E_VIS.unit(span.label.phone) for span in SOUND.units]
    other = generated(replace(SOUND, units_known=False))  # whatever the given units
    assert recognised().motion.values == pytest.approx(other.motion.values, abs=1e-9)
    found = recognised().units
    assert found == other.units
    assert [E_VIS.unit_of(span.label) for span in found] == said
    for span, unit in zip(found, said, strict=True):
        if unit == "silence":
            assert span.label.phone == "sil"
        else:
            assert len(E_VIS.phones(unit)) > 1
            assert span.label == types.Unit("", unit, confidence=0.0)


def test_recognised_units_may_be_given_and_come_back_as_they_are() -> None:
    first = recognised()
    again = generated(replace(SOUND, units=first.units))
    assert again.units == first.units
    silent_from = round(100 * first.units[-1].start_s) - 15
    assert again.motion.values[:silent_from] == pytest.approx(first.motion.values[:silent_from], abs=1e-9)


def test_lips_meet_in_recognised_units_of_p_b_m_alone() -> None:
    closed, free = recognised().motion["opening"], recognised(closures=False).motion["opening"]
    closure = trained("eVis").closure
    lips = [slice(80, 90), slice(100, 110)]
    for span in lips:
        assert closed[span].min() <= closure.closed + 1e-9
    assert any(free[span].min() > closure.closed for span in lips)


def late(units: types.Timeline[types.Unit], by_s: float) -> types.Timeline[types.Unit]:
    """Return units whose inner bounds are all later."""
    edges = [units[0].start_s, *(span.start_s + by_s for span in units.spans[1:]), units[-1].end_s]
    return types.Timeline(tuple(types.Span(a, b, s.label) for a, b, s in zip(edges, edges[1:], units, strict=False)))


def test_own_alignment_gives_the_times_of_the_sound_to_the_phones_of_words() -> None:
    mistimed = replace(SOUND, units=late(SOUND.units, 0.05))
    kept, own = generated(mistimed), generated(mistimed, own_alignment=True)
    assert spans(kept.units) == spans(mistimed.units)
    assert [label for *_, label in spans(own.units)] == [label for *_, label in spans(SOUND.units)]
    for found, said in zip(own.units, SOUND.units, strict=True):
        assert found.start_s == pytest.approx(said.start_s, abs=0.025)
    assert np.abs(own.motion["opening"] - kept.motion["opening"]).max() > 0.05
    times_given = generated(replace(mistimed, times_given=True), own_alignment=True)
    assert times_given.motion.values == pytest.approx(kept.motion.values, abs=1e-9)


def test_a_flat_start_is_that_of_units_of_equal_length() -> None:
    """Eight units of three states in 144 frames: six frames a state."""
    phones = ("t", "aa", "p", "iy", "m", "aa")
    whole = [example(phones, seed, duration_s=0.04) for seed in range(3)]
    assert {len(each.speech.features.values) for each in whole} == {145}
    cut = []
    for each in whole:
        features = replace(each.speech.features, values=each.speech.features.values[:144])
        motion = replace(each.motion, values=each.motion.values[:144])
        speech = replace(each.speech, features=features)
        cut.append(replace(each, speech=speech, motion=motion, valid=each.valid[:144]))
    labels = [span.label for span in whole[0].speech.units]
    equal = types.Timeline(tuple(types.Span(0.18 * n, 0.18 * (n + 1), label) for n, label in enumerate(labels)))
    divided = [replace(each, speech=replace(each.speech, units=equal)) for each in cut]

    def means(data: list[types.Example], flat: bool) -> np.ndarray:
        hmm = engine("phone", flat_start=flat).fit(data, types.silent_monitor).model.hmm
        return hmm.models["speech"].tied.mixtures.means

    flat = means(cut, flat=True)
    assert flat == pytest.approx(means(divided, flat=False), abs=1e-5)
    timed = means(cut, flat=False)
    assert timed.shape != flat.shape or np.abs(timed - flat).max() > 0.1


def test_the_stages_of_a_training_are_trainings_of_their_own() -> None:
    data = examples(8)
    stages = list(engine(mixtures=4).growing_models(data, types.silent_monitor))
    assert [stage.hmm.models["speech"].tied.mixtures.size[1] for stage in stages] == [1, 2, 4]
    alone = trained("eVis")
    assert np.array_equal(
        stages[0].hmm.models["speech"].tied.mixtures.means, alone.hmm.models["speech"].tied.mixtures.means
    )
    assert np.array_equal(stages[0].hmm.log_stay, alone.hmm.log_stay)


def test_the_two_features_of_the_paper_alone() -> None:
    """§3: "only two features for the lips (mouth opening, pucker)"; the others are in no part of the model."""
    alone = engine(channels="opening width", motion_mixtures=2)
    model = alone.fit(examples(8), types.silent_monitor).model
    assert model.space.dimensions == 2
    made, every = alone.generate(model, SOUND).motion, generated(SOUND).motion
    assert made.names == ("opening", "width")
    assert np.corrcoef(made["opening"], every["opening"])[0, 1] > 0.9
    assert set(every.names) > set(made.names)
    with pytest.raises(errors.InputError, match="pucker"):
        engine(channels="opening pucker").fit(examples(2), types.silent_monitor)


def test_the_preset_is_the_system_of_the_paper() -> None:
    config = engines.create_engine(preset="hofer2008").config
    assert (config.units, config.states, config.f0) == ("eVis", 5, True)
    assert (config.closures, config.articulation) == (False, False)
    assert config.recognise_units
    assert config.own_alignment
    assert config.hmm.both_neighbours
    assert config.hmm.recognition == StreamWeights(motion=0.0)
    settings = ["speech_weight=0.5", "f0_weight=0.25", "motion_weight=2", "recognition_f0_weight=0"]
    weighted = engines.create_engine(preset="hofer2008", settings=settings).config.hmm
    assert weighted.training == StreamWeights(0.5, 0.25, 0.25, 0.25, 2.0)
    assert weighted.recognition == StreamWeights(1.0, 0.0, 0.0, 0.0, 0.0)


def test_weights_that_switch_everything_off_and_units_of_another_set_are_refused() -> None:
    with pytest.raises(errors.InputError, match="no stream takes part in recognition"):
        engines.engine_named("joint", {"recognition_speech_weight": 0.0, "f0": False})
    with pytest.raises(errors.InputError, match="all streams are switched off in training"):
        engines.engine_named("joint", {"speech_weight": 0.0, "f0_weight": 0.0, "motion_weight": 0.0})
    unknown = types.Timeline((types.Span(0.0, 1.0, types.Unit("", "WQ")),))
    with pytest.raises(errors.InputError, match=r"unknown unit 'WQ' without a phone; give a phone, or one of aw ay"):
        generated(replace(SOUND, units=unknown))
