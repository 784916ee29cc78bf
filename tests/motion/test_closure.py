import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.engines import engine_named
from lipmotion.motion.closure import (
    Closure,
    choose_closed_frames,
    estimate_closed_opening,
    estimate_closure,
    find_closable_ranges,
)
from lipmotion.testing.examples import PHONES, examples, speech
from lipmotion.types import Constraints, Pin, Span, Timeline, Unit
from lipmotion.types.progress import silent_monitor

ENGINE = engine_named("trajectory", {})
MODEL = ENGINE.fit(examples(), silent_monitor).model


def spoken(phones, durations) -> Timeline[Unit]:
    """Phones of given lengths (10 ms frames) between half seconds of silence."""
    edges = (50 + np.cumsum([0, *durations])) / 100
    inner = [Span(a, b, Unit(p)) for a, b, p in zip(edges.tolist(), edges[1:].tolist(), phones, strict=False)]
    end_s = float(edges[-1])
    return Timeline((Span(0.0, 0.5, Unit("sil")), *inner, Span(end_s, end_s + 0.5, Unit("sil"))))


SPOKEN = st.lists(
    st.tuples(st.one_of(st.sampled_from("pbm"), st.sampled_from(PHONES[1:])), st.integers(2, 15)),
    min_size=1,
    max_size=8,
).map(lambda pairs: spoken(*zip(*pairs, strict=True)))
PINS = st.lists(st.tuples(st.integers(40, 120), st.floats(0, 0.4)), max_size=3)


@given(units=SPOKEN, pins=PINS)
@settings(max_examples=20)
def test_the_lips_meet_in_every_p_b_and_m_that_the_user_left_alone(units, pins):
    talk = speech(units)
    wanted = [(frame, value) for frame, value in pins if frame < len(talk.features.values)]
    constraints = Constraints(tuple(Pin(frame / 100, "opening", value) for frame, value in wanted))
    opening = ENGINE.generate(MODEL, talk, constraints).motion["opening"]
    pinned = {frame for frame, _ in wanted}
    for frames in find_closable_ranges(units, len(opening)):
        if not pinned & set(range(frames.start, frames.stop)):
            assert opening[frames].min() <= MODEL.closure.closed + 1e-12
    assert opening.min() >= 0


def test_closures_can_be_left_to_the_model():
    pure = engine_named("trajectory", {"closures": False})
    talk = speech(spoken(("aa", "p", "aa"), (12, 3, 12)))
    free, closed = (engine.generate(MODEL, talk).motion["opening"] for engine in (pure, ENGINE))
    frames = find_closable_ranges(talk.units, len(free))[0]
    assert free[frames].min() > MODEL.closure.closed
    assert closed[frames].min() <= MODEL.closure.closed


def test_what_is_pinned_does_not_follow_the_closure():
    talk = speech(spoken(("aa", "p", "aa"), (12, 3, 12)))
    width = ENGINE.generate(MODEL, talk, Constraints((Pin(0.62, "width", 0.5),))).motion["width"]
    assert width[62] == 0.5
    outer = ENGINE.generate(MODEL, talk, Constraints((Pin(0.62, "opening", 0.3),))).motion["opening"]
    assert outer[62] == 0.3


def test_spans_reach_two_frames_beyond_the_phone_and_stay_inside():
    units = Timeline((Span(0.0, 0.05, Unit("p")), Span(0.1, 0.15, Unit("aa")), Span(0.995, 1.01, Unit("m"))))
    assert find_closable_ranges(units, 101) == [slice(0, 8), slice(98, 101)]
    assert find_closable_ranges(units, 90) == [slice(0, 8)]


def test_an_em_closes_and_an_en_does_not():
    units = Timeline((Span(0.1, 0.2, Unit("em")), Span(0.2, 0.3, Unit("en"))))
    assert len(find_closable_ranges(units, 50)) == 1


def test_only_frames_that_do_not_close_anyway_are_chosen():
    units = Timeline((Span(0.1, 0.2, Unit("p")), Span(0.3, 0.4, Unit("b")), Span(0.5, 0.6, Unit("m"))))
    opening = np.full(80, 0.2)
    opening[[15, 34, 55]] = 0.01, 0.06, 0.07
    closure = Closure(0, 0.05, np.ones(1))
    assert choose_closed_frames(closure, opening, find_closable_ranges(units, 80), []) == [34, 55]
    assert choose_closed_frames(closure, opening, find_closable_ranges(units, 80), [52]) == [34]


def test_how_closed_is_the_median_of_the_least_openings():
    units = Timeline(tuple(Span(0.1 * n, 0.1 * n + 0.1, Unit("p" if n % 2 else "aa")) for n in range(6)))
    x = np.full((60, 2), 0.3)
    x[[15, 35, 55], 0] = 0.01, 0.02, 0.05
    x[:, 1] = 1 - 2 * x[:, 0]
    everything = np.ones(60, bool)
    closure = estimate_closure([x], [everything], [units], column=0)
    assert closure.closed == 0.02
    assert closure.follow == pytest.approx([1, -2])
    unseen = everything.copy()
    unseen[5:25] = False
    assert estimate_closure([x], [unseen], [units], column=0).closed == pytest.approx((0.02 + 0.05) / 2)


def test_a_mouth_closes_to_nothing_less():
    """A spline through the camera's frames may swing below zero; the lips cannot."""
    units = Timeline((Span(0.1, 0.2, Unit("p")),))
    x = np.full((30, 1), 0.3)
    x[15] = -0.01
    assert estimate_closure([x], [np.ones(30, bool)], [units], column=0).closed == 0


def test_without_p_b_or_m_the_second_percentile_is_closed():
    x = np.linspace(0, 1, 101)[:, None]
    closure = estimate_closure([x], [np.ones(101, bool)], [Timeline((Span(0.0, 1.0, Unit("aa")),))], column=0)
    assert closure.closed == pytest.approx(0.02)


def test_lips_that_a_wrong_phone_shows_open_are_closed_as_far_as_the_frames_say():
    rng = np.random.default_rng(0)
    frames = np.concatenate([rng.uniform(0.0, 0.01, 40), rng.uniform(0.05, 0.2, 960)])
    assert estimate_closed_opening([0.126], frames) <= 0.01
    assert estimate_closed_opening([], frames) <= 0.01
    assert estimate_closed_opening([0.003, 0.004, 0.005], frames) == 0.004
    assert estimate_closed_opening([0.126], frames + 0.1, frames) == estimate_closed_opening([0.126], frames)
    assert estimate_closed_opening([-0.02], frames) == 0
    assert estimate_closed_opening([], np.empty(0)) == 0
