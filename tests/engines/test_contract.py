"""What every engine promises, whatever it does inside."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.engines import ENGINES, engine_named
from lipmotion.engines.base import Explains, HasPosteriors, explain_by_trace
from lipmotion.errors import CorpusError, InputError, ModelFormatError
from lipmotion.testing.examples import CHANNELS, RATE_HZ, example, examples, motion, speech, timeline
from lipmotion.types import Constraints, Features, Pin, Span, Speech, Timeline, Unit
from lipmotion.types.progress import silent_monitor
from lipmotion.units import PHONES, UNIT_SETS

SENTENCE = ("t", "aa", "p", "iy", "m", "uw", "s", "aa")


SYSTEMS = {
    **{name: (name, {}) for name in sorted(ENGINES.names)},
    **{f"trajectory of {units}": ("trajectory", {"units": units}) for units in UNIT_SETS if units != "phone"},
    "plain trajectory of eVis": ("trajectory", {"units": "eVis", "acoustic_regression": False}),
}
"""Every engine as it is, and its other settings that change what the model holds."""


class Trained:
    """A system and what it learned from a few sentences."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.engine = engine_named(*SYSTEMS[name])
        self.model = self.engine.fit(examples(), silent_monitor).model

    def generate(self, spoken: Speech, *pins: Pin):
        return self.engine.generate(self.model, spoken, Constraints(pins))


@cache
def engine_called(name: str) -> Trained:
    return Trained(name)


@pytest.fixture(params=SYSTEMS)
def trained(request) -> Trained:
    return engine_called(request.param)


def same(one, two) -> bool:
    return all(
        a.tobytes() == b.tobytes() for a, b in ((one.motion.values, two.motion.values), (one.variance, two.variance))
    )


def test_motion_has_a_row_for_every_feature_frame(trained):
    spoken = speech(timeline(SENTENCE))
    result = trained.generate(spoken)
    assert result.motion.values.shape == (len(spoken.features.values), len(CHANNELS))
    assert result.motion.rate_hz == RATE_HZ
    assert result.motion.channels == CHANNELS
    assert result.variance.shape == result.motion.values.shape
    assert np.isfinite(result.motion.values).all()
    assert np.isfinite(result.variance).all()
    assert (result.variance >= 0).all()


def test_what_was_learned_comes_back(trained):
    """A sentence of the kind trained on: the engine must not be a constant."""
    spoken = speech(timeline(SENTENCE))
    original = motion(spoken.units, len(spoken.features.values), seed=99)
    generated = trained.generate(spoken).motion
    for name in ("opening", "width", "y_17"):
        assert np.corrcoef(generated[name], original[name])[0, 1] > 0.9


def test_a_unit_without_a_phone_is_refused_by_all_that_do_not_know_it(trained):
    unknown = Timeline((Span(0.1, 0.4, Unit("", "of another set")),))
    with pytest.raises(InputError, match=r"without a phone.*; give"):
        trained.generate(speech(unknown))


def test_lips_are_made_to_meet_unless_the_pins_are_taken_away(trained):
    spoken = speech(timeline(SENTENCE))
    free = trained.engine.without_closures()
    assert (trained.engine.config.closures, free.config.closures) == (True, False)
    assert free.without_closures() == free
    pinned, opening = (engine.generate(trained.model, spoken).motion["opening"] for engine in (trained.engine, free))
    lips = [slice(78, 93), slice(98, 113)]
    assert all(pinned[span].min() <= opening[span].min() + 1e-9 for span in lips)


def test_the_trace_names_a_state_for_every_frame(trained):
    result = trained.generate(speech(timeline(SENTENCE)))
    assert len(result.trace.frames) == len(result.motion.values)
    assert result.trace.frames.min() >= 0
    assert result.trace.frames.max() < len(result.trace.states)
    assert all(result.trace.states)


def explained(trained, spoken, frames):
    if isinstance(trained.engine, Explains):
        return trained.engine.explain(trained.model, spoken, frames)
    result = trained.engine.generate(trained.model, spoken)
    return tuple(explain_by_trace(result, frame) for frame in frames)


def test_every_frame_has_an_explanation(trained):
    spoken = speech(timeline(SENTENCE))
    result = trained.generate(spoken)
    frames = range(len(result.motion.values))
    found = explained(trained, spoken, frames)
    assert [one.frame for one in found] == list(frames)
    assert [one.state for one in found] == [result.trace.states[state] for state in result.trace.frames]
    assert [[one.motion[name].value for name in result.motion.names] for one in found] == result.motion.values.tolist()
    deviations = np.array([[value.deviation for value in one.motion.values()] for one in found])
    assert deviations**2 == pytest.approx(result.variance)
    assert found[65].span in result.units.spans
    assert found[65].span.start_s <= 0.65 < found[65].span.end_s
    for one in found:
        assert len(one.chains) == len(found[0].chains)
        assert bool(one.chains) is bool(one.gaussians) is isinstance(trained.engine, HasPosteriors)
    assert explained(trained, spoken, [7, 3, 7]) == (found[7], found[3], found[7])


def test_posteriors_are_probabilities(trained):
    if not isinstance(trained.engine, HasPosteriors):
        return
    spoken = speech(timeline(SENTENCE))
    first, *others = trained.engine.posteriors(trained.model, spoken)
    for one in (first, *others):
        assert one.probability.shape == (len(spoken.features.values), len(one.units))
        assert one.probability.sum(axis=1) == pytest.approx(1, abs=1e-4)
        assert one.lead.shape == (len(one.probability), len(one.leads))
    assert first.leads == ()
    assert all(one.lead.sum(axis=1) == pytest.approx(1, abs=1e-4) for one in others if one.leads)


def test_units_keep_their_times_and_say_what_they_resolved_to(trained):
    spoken = speech(timeline(SENTENCE))
    result = trained.generate(spoken)
    assert [(s.start_s, s.end_s, s.label.phone) for s in result.units] == [
        (s.start_s, s.end_s, s.label.phone) for s in spoken.units
    ]
    assert all(span.label.unit for span in result.units)
    assert same(trained.generate(replace(spoken, units=result.units)), result)  # and may be passed back


@settings(deadline=None, max_examples=25)
@given(data=st.data())
@pytest.mark.parametrize("name", SYSTEMS)
def test_pins_are_exact(name, data):
    trained = engine_called(name)
    spoken = speech(timeline(("p", "aa", "m")))
    frames = len(spoken.features.values)
    places = st.tuples(st.integers(0, frames - 1), st.sampled_from(["opening", "width"]))
    wanted = data.draw(st.dictionaries(places, st.floats(0, 1), max_size=12))
    result = trained.generate(spoken, *(Pin(frame / RATE_HZ, name, v) for (frame, name), v in wanted.items()))
    assert np.isfinite(result.motion.values).all()
    assert (result.variance >= 0).all()
    for (frame, channel), value in wanted.items():
        assert result.motion[channel][frame] == value
        assert result.variance[frame, result.motion.names.index(channel)] == 0


def test_a_pin_holds_in_the_nearest_frame_and_the_last_of_two_wins(trained):
    result = trained.generate(speech(timeline(SENTENCE)), Pin(0.7, "width", 9.0), Pin(0.7049, "width", 0.5))
    assert result.motion["width"][70] == 0.5
    assert result.motion["width"].max() < 2


@pytest.mark.parametrize(
    "pin",
    [
        Pin(0.5, "no such channel", 0.1),
        Pin(-0.006, "opening", 0.1),
        Pin(99.0, "opening", 0.1),
        Pin(float("nan"), "opening", 0.1),
        Pin(float("inf"), "opening", 0.1),
        Pin(0.5, "opening", float("nan")),
        Pin(0.5, "opening", float("-inf")),
    ],
)
def test_pins_that_cannot_be_are_input_errors(trained, pin):
    with pytest.raises(InputError):
        trained.generate(speech(timeline(SENTENCE)), pin)


def test_pins_at_both_ends_are_inside(trained):
    spoken = speech(timeline(SENTENCE))
    last_s = (len(spoken.features.values) - 1) / RATE_HZ
    result = trained.generate(spoken, Pin(-0.004, "opening", 0.1), Pin(last_s + 0.004, "opening", 0.2))
    assert result.motion["opening"][[0, -1]].tolist() == [0.1, 0.2]


def test_no_constraints_are_empty_constraints(trained):
    spoken = speech(timeline(SENTENCE))
    assert same(trained.engine.generate(trained.model, spoken), trained.generate(spoken))


def test_the_same_input_gives_the_same_bytes(trained):
    spoken = speech(timeline(SENTENCE))
    again = Trained(trained.name)
    assert same(trained.generate(spoken), trained.generate(spoken))
    assert same(again.generate(spoken), trained.generate(spoken))


def test_a_model_comes_back_from_arrays(trained):
    arrays = trained.engine.to_arrays(trained.model)
    assert all(array.dtype != object for array in arrays.values())
    back = trained.engine.from_arrays(arrays)
    spoken = speech(timeline(SENTENCE))
    one, two = trained.generate(spoken), trained.engine.generate(back, spoken)
    assert two.motion.values == pytest.approx(one.motion.values, abs=2e-3)  # half precision
    assert two.variance == pytest.approx(one.variance, rel=1e-2, abs=1e-9)
    assert two.motion.channels == one.motion.channels
    assert two.trace.states == one.trace.states
    third = trained.engine.from_arrays(trained.engine.to_arrays(back))
    assert same(trained.engine.generate(third, spoken), two)  # stored values stay what they are


def test_a_model_with_an_array_missing_is_damaged(trained):
    arrays = trained.engine.to_arrays(trained.model)
    for name in arrays:
        with pytest.raises(ModelFormatError):
            trained.engine.from_arrays({key: array for key, array in arrays.items() if key != name})


def test_a_model_with_an_array_cut_short_is_damaged(trained):
    arrays = trained.engine.to_arrays(trained.model)
    for name in arrays:
        with pytest.raises(ModelFormatError):
            trained.engine.from_arrays(arrays | {name: arrays[name][:-1]})


def test_trees_can_be_read(trained):
    text = trained.engine.describe(trained.model)
    assert ("leaf (" in text) is (trained.engine.name != "coupled")  # whose states are tied by unit alone
    assert text
    assert max(map(len, text.splitlines())) < 200


@pytest.mark.parametrize("phone", PHONES)
def test_every_phone_of_the_inventory_resolves(trained, phone):
    result = trained.generate(speech(timeline(("aa", phone, "zh", phone))))
    assert np.isfinite(result.motion.values).all()
    assert -0.1 < result.motion["opening"].min() <= result.motion["opening"].max() < 0.5


def test_a_phone_outside_the_inventory_is_an_input_error(trained):
    with pytest.raises(InputError, match="xx"):
        trained.generate(speech(timeline(("aa", "xx"))))


@pytest.mark.parametrize(
    "units",
    [
        Timeline(()),
        Timeline((Span(0.0, 0.5, Unit("sil")),)),
        Timeline((Span(0.0, 0.5, Unit("aa")),)),
        Timeline((Span(0.1, 0.1, Unit("p")), Span(0.2, 0.2001, Unit("aa")), Span(0.31, 0.4, Unit("m")))),
        Timeline((Span(-1.0, 0.2, Unit("aa")), Span(0.2, 9.0, Unit("p")))),
    ],
    ids=["no units", "silence", "one phone", "gaps and hardly any time", "beyond both ends"],
)
@pytest.mark.parametrize("frames", [1, 2, 3, 51])
def test_odd_timelines_and_the_shortest_recordings(trained, units, frames):
    features = Features(np.zeros((frames, 39), np.float32), (frames - 1) / RATE_HZ)
    result = trained.generate(Speech(features, units))
    assert result.motion.values.shape == (frames, len(CHANNELS))
    assert np.isfinite(result.motion.values).all()
    assert (result.variance >= 0).all()


@pytest.mark.parametrize("name", SYSTEMS)
def test_nothing_to_learn_from_is_a_corpus_error(name):
    engine = engine_named(*SYSTEMS[name])
    unseen = [replace(e, valid=np.zeros_like(e.valid)) for e in examples(2)]
    silent = [example(()) for _ in range(2)]
    for useless in ([], unseen, silent):
        with pytest.raises(CorpusError):
            engine.fit(useless, silent_monitor)


@pytest.mark.parametrize("name", SYSTEMS)
def test_examples_of_different_channels_are_a_corpus_error(name):
    one, two = examples(2)
    fewer = replace(two.motion, values=two.motion.values[:, :2], channels=two.motion.channels[:2])
    with pytest.raises(CorpusError, match="channels"):
        engine_named(*SYSTEMS[name]).fit([one, replace(two, motion=fewer)], silent_monitor)


@pytest.mark.parametrize("name", SYSTEMS)
def test_frames_that_were_not_seen_teach_nothing(name):
    engine, generated = engine_named(*SYSTEMS[name]), []
    for garbage in (0.0, -7.0):
        spoilt = []
        for number, clean in enumerate(examples(6)):
            valid = clean.valid.copy()
            valid[60 + 10 * number : 75 + 10 * number] = False
            values = np.where(valid[:, None], clean.motion.values, garbage)
            spoilt.append(replace(clean, motion=replace(clean.motion, values=values), valid=valid))
        model = engine.fit(spoilt, silent_monitor).model
        generated.append(engine.generate(model, speech(timeline(SENTENCE))))
    assert same(*generated)


@pytest.mark.parametrize("name", SYSTEMS)
def test_one_short_example_is_enough(name):
    engine = engine_named(*SYSTEMS[name])
    model = engine.fit([example(("p", "aa"))], silent_monitor).model
    result = engine.generate(model, speech(timeline(SENTENCE)))
    assert np.isfinite(result.motion.values).all()
    assert (result.variance >= 0).all()


def test_an_unknown_engine_or_option_is_an_input_error():
    with pytest.raises(InputError, match="trajectory"):
        engine_named("no such engine", {})
    for name in ENGINES.names:
        with pytest.raises(InputError, match="no_such_option"):
            engine_named(name, {"no_such_option": 1})
