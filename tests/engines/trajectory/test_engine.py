from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from lipmotion import engines, errors
from lipmotion.testing.examples import CHANNELS, OPENINGS, examples, speech, timeline
from lipmotion.types import WEIGHT, Channel, Constraints, Pin, silent_monitor

ENGINE = engines.engine_named("trajectory", {"silent_states": 7, "articulation": False})  # at rest from 0.24 s on


@cache
def model() -> object:
    return ENGINE.fit(examples(), silent_monitor).model


def test_a_configuration_that_makes_no_sense_is_an_input_error():
    for options in (
        {"states": 4}, {"edge_s": 0.0}, {"components": 0}, {"shrinkage": -1.0}, {"silent_states": 2},
        {"ridge_frames": float("nan")}, {"modulation_filter": -0.5},
    ):  # fmt: skip
        with pytest.raises(errors.InputError):
            engines.engine_named("trajectory", options)


def test_any_odd_number_of_states_works():
    for states in (1, 7):
        engine = engines.engine_named("trajectory", {"states": states, "components": 2})
        model = engine.fit(examples(4), silent_monitor).model
        values = engine.generate(model, speech(timeline(("p", "aa", "m")))).motion.values
        assert np.isfinite(values).all()


def test_the_mouth_rests_in_silence_and_does_not_learn_to_lick_the_lips_there():
    """Away from speech the opening is that of silence, and still."""
    spoken = speech(timeline(("aa", "iy", "aa")))
    opening = ENGINE.generate(model(), spoken).motion["opening"]
    for rest in (opening[:25], opening[-25:]):
        assert rest == pytest.approx(np.full(25, OPENINGS["sil"]), abs=2e-3)
        assert np.ptp(rest) < 2e-3
    restless = examples()
    for example in restless[:5]:
        example.motion.values[10:20, 0] += 0.2
    opening = ENGINE.generate(ENGINE.fit(restless, silent_monitor).model, spoken).motion["opening"]
    assert opening[:25].max() < OPENINGS["sil"] + 0.01


def test_variance_is_smaller_near_a_pin_and_what_is_far_stays():
    talk = speech(timeline(("aa", "iy", "t", "uw", "s", "aa")))
    free = ENGINE.generate(model(), talk)
    pinned = ENGINE.generate(model(), talk, Constraints((Pin(0.9, "width", 0.7),)))
    width = [channel.name for channel in CHANNELS].index("width")
    assert (pinned.variance[88:93, width] < free.variance[88:93, width]).all()
    assert pinned.motion["width"][:60] == pytest.approx(free.motion["width"][:60], abs=1e-4)
    assert pinned.motion["opening"] == pytest.approx(free.motion["opening"], abs=1e-12)


def test_points_cannot_be_pinned_and_a_mouth_not_further_than_shut():
    for pin, message in ((Pin(0.5, "x_17", 0.0), r"opening, width$"), (Pin(0.5, "opening", -0.1), "at least 0")):
        with pytest.raises(errors.InputError, match=message):
            ENGINE.generate(model(), speech(timeline(("aa",))), Constraints((pin,)))


def test_an_edited_unit_changes_the_motion_around_it_only():
    talk, other = (speech(timeline(("t", "aa", phone, "aa", "t", "s"))) for phone in ("iy", "uw"))
    one, two = (ENGINE.generate(model(), s).motion["width"] for s in (talk, other))
    assert np.abs(one - two)[80:90].max() > 0.05
    assert one[:50] == pytest.approx(two[:50], abs=1e-4)  # the acoustic context reaches a quarter of a second
    assert one[-50:] == pytest.approx(two[-50:], abs=1e-4)


def weighted():
    """The same motion as weights of blendshapes that are mostly 0, and one that is always 0.3."""
    channels = tuple(Channel(name, WEIGHT) for name in ("jaw", "funnel", "still"))
    for number, one in enumerate(examples()):
        opening = one.motion["opening"]
        shapes = [np.maximum(opening - 0.1, 0), np.maximum(0.5 - one.motion["width"], 0), 0 * opening + 0.3]
        yield replace(
            one, name=f"{number}", motion=replace(one.motion, values=np.stack(shapes, axis=1), channels=channels)
        )


def test_blendshapes_without_an_opening():
    """No closing is pinned; weights are followed, never negative, and what never moves stays where it is."""
    model = ENGINE.fit(list(weighted()), silent_monitor).model
    assert model.closure is None
    quiet = ENGINE.generate(model, speech(timeline(()))).motion  # at rest, the median pose
    np.testing.assert_allclose(quiet["jaw"], 0, atol=1e-3)
    np.testing.assert_allclose(quiet["funnel"], 0, atol=1e-3)
    kept = ENGINE.from_arrays(ENGINE.to_arrays(model))
    spoken = speech(timeline(("t", "aa", "p", "uw", "s", "aa", "m", "iy")))
    result = ENGINE.generate(kept, spoken)
    assert result.motion.values.min() >= 0
    assert result.motion["jaw"].max() > 0.1
    assert result.motion["funnel"].max() > 0.04
    np.testing.assert_allclose(result.motion["still"], 0.3, atol=1e-3)
    pressed = ENGINE.generate(kept, spoken, Constraints((Pin(0.9, "jaw", 0.25),)))
    assert pressed.motion["jaw"][90] == 0.25
    with pytest.raises(errors.InputError, match=r"sets jaw to -0\.1, required at least 0"):
        ENGINE.generate(kept, spoken, Constraints((Pin(0.9, "jaw", -0.1),)))


def test_models_from_before_the_modulation_filter_have_none():
    former = {name: value for name, value in ENGINE.config.as_mapping().items() if name != "modulation_filter"}
    engine = engines.engine_named("trajectory", former, stored=True)
    assert engine.config.modulation_filter == 0
    assert engine.config.as_mapping() == former  # so that earlier versions can read it
    arrays = ENGINE.to_arrays(model())
    arrays.pop("modulation")
    talk = speech(timeline(("aa", "iy", "t", "uw", "s", "aa")))
    one = engine.generate(engine.from_arrays(arrays), talk).motion.values
    two = ENGINE.generate(replace(model(), modulation=None), talk).motion.values
    assert one == pytest.approx(two, abs=2e-3)  # half precision
