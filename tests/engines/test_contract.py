from functools import cache

import numpy as np
import pytest

from lipmotion import errors, types
from lipmotion.engines import ENGINES, base, engine_named
from lipmotion.testing import ENGINE_CHECKS, TrainedEngine, speech, timeline

SENTENCE = ("t", "aa", "p", "iy", "m", "uw", "s", "aa")
SYSTEMS = {
    **{name: (name, {}) for name in sorted(ENGINES.names)},
    "coupled": ("coupled", {"chains": "sVis 2vis", "mixtures": 2}),
    "trajectory of 2vis": ("trajectory", {"units": "2vis"}),
    "plain trajectory of eVis": ("trajectory", {"units": "eVis", "acoustic_regression": False}),
}
"""Every engine as it is, the coupled one smaller, and other settings that change what the model holds."""


@cache
def engine_called(name: str) -> TrainedEngine:
    return TrainedEngine(engine_named(*SYSTEMS[name]))


OTHERS = [pytest.param(name, marks=pytest.mark.long) for name in SYSTEMS if name not in ENGINES.built_in]


@pytest.fixture(params=[*ENGINES.built_in, *OTHERS])
def trained(request) -> TrainedEngine:
    return engine_called(request.param)


SLOW_CHECKS = {
    ("coupled", "damaged arrays are format errors"),
    ("coupled", "frames that are not valid teach nothing"),
    ("coupled", "the same input gives the same bytes"),
}
"""Every array of the largest model is damaged in three ways, or it is trained again."""
CONTRACT = [
    pytest.param(name, check, marks=[pytest.mark.long] * (name not in ENGINES.built_in or (name, check) in SLOW_CHECKS))
    for name in SYSTEMS
    for check in ENGINE_CHECKS
]


@pytest.mark.parametrize(("name", "check"), CONTRACT)
def test_the_contract_is_kept(name, check):
    ENGINE_CHECKS[check](engine_called(name))


def test_unknown_units_and_phones_are_refused_by_all_that_do_not_know_them(trained):
    unknown = types.Timeline((types.Span(0.1, 0.4, types.Unit("", "of another set")),))
    with pytest.raises(errors.InputError, match=r"without a phone.*; give"):
        trained.generate(speech(unknown))
    with pytest.raises(errors.InputError, match="xx"):
        trained.generate(speech(timeline(("aa", "xx"))))


def test_a_frame_is_explained_by_its_own_span_state_and_values() -> None:
    units = types.Timeline((types.Span(0.0, 0.02, types.Unit("p")), types.Span(0.02, 0.04, types.Unit("aa"))))
    motion = types.Motion(np.arange(10.0).reshape(5, 2), 100.0, (types.Channel("opening"), types.Channel("width")))
    variance = np.square(np.arange(10.0, 20.0).reshape(5, 2))
    result = types.Generation(motion, variance, units, types.StateTrace(("one", "two"), np.array([0, 0, 1, 1, 1])))
    found = [base.explain_by_trace(result, frame) for frame in range(5)]
    assert [one.span.label.phone if one.span else None for one in found] == ["p", "p", "aa", "aa", None]
    assert [one.state for one in found] == ["one", "one", "two", "two", "two"]
    assert (found[3].motion["width"].value, found[3].motion["width"].deviation) == (7, 17)
    assert [one.time_s for one in found] == [0, 0.01, 0.02, 0.03, 0.04]


def explained(trained, spoken, frames):
    found = trained.engine.explain(trained.model, spoken, frames)
    result = trained.engine.generate(trained.model, spoken)
    return found if found is not None else tuple(base.explain_by_trace(result, frame) for frame in frames)


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
    chains = len(trained.engine.posteriors(trained.model, spoken))
    assert chains == (2 if trained.engine.name == "coupled" else 0)
    for one in found:
        assert len(one.chains) == chains
        assert bool(one.chains) is bool(one.gaussians)
    assert explained(trained, spoken, [7, 3, 7]) == (found[7], found[3], found[7])


def test_pins_at_both_ends_are_inside(trained):
    spoken = speech(timeline(SENTENCE))
    last_s = (len(spoken.features.values) - 1) / types.FRAME_RATE_HZ
    result = trained.generate(spoken, types.Pin(-0.004, "opening", 0.1), types.Pin(last_s + 0.004, "opening", 0.2))
    assert result.motion["opening"][[0, -1]].tolist() == [0.1, 0.2]


def test_trees_can_be_read(trained):
    text = trained.engine.describe(trained.model)
    assert ("leaf (" in text) is (trained.engine.name in ("trajectory", "joint"))  # the others have no trees
    assert bool(text) is ("leaf (" in text)
    assert max(map(len, text.splitlines()), default=0) < 200
