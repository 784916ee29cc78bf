import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.engines import engine_named
from lipmotion.errors import ModelFormatError
from lipmotion.motion.closure import (
    Closure,
    choose_closed_frames,
    estimate_closed_opening,
    estimate_closure,
    find_closable_ranges,
)
from lipmotion.motion.space import MotionLimits, MotionSpace, check_poses, check_rest, check_spread, measure_limits
from lipmotion.stats.pca import Pca
from lipmotion.testing import PHONES, examples, speech
from lipmotion.types import GREY, WEIGHT, Channel, Constraints, Pin, Span, Timeline, Unit, silent_monitor

POSES = np.array([[0.0, 0.5], [0.3, 0.6], [0.1, 0.55]])
REACH = measure_limits(POSES)
CLOSURE = Closure(0, 0.02, np.array([1.0, 0.2]))


def space(*units: str) -> MotionSpace:
    channels = tuple(Channel(name, unit) for name, unit in zip(("opening", "width"), units, strict=True))
    return MotionSpace(channels, np.arange(2), None)


FACE = space("eye_distance", "eye_distance")


def test_reach_is_what_poses_span() -> None:
    assert (REACH.low.tolist(), REACH.high.tolist()) == ([0.0, 0.5], [0.3, 0.6])
    wide = REACH.extend(np.array([0.1, 0.01]))
    assert wide.low == pytest.approx([-0.3, 0.47])
    assert wide.high == pytest.approx([0.6, 0.63])


@pytest.mark.parametrize("value", [7.0, -7.0, 1e38, np.nan, np.inf])
@pytest.mark.parametrize("column", [0, 1])
def test_motion_far_from_all_poses(value: float, column: int) -> None:
    REACH.check(np.array([[-0.5, 0.2], [2.0, 1.5]]), CLOSURE, {})  # near enough
    values = np.tile(REACH.low, (3, 1))
    values[1, column] = value
    with pytest.raises(ModelFormatError, match=r"the motion would go from .* the model is damaged; train or download"):
        REACH.check(values, CLOSURE, {})


def test_pins_lead_farther_and_what_follows_the_opening_with_them() -> None:
    values = np.array([[0.0, 0.5], [200.0, 40.0]])
    REACH.check(values, CLOSURE, {(1, 0): 200.0})
    with pytest.raises(ModelFormatError):
        REACH.check(values, None, {(1, 0): 200.0})


def test_rest_is_near_the_poses_and_dimensions_may_not_move() -> None:
    check_rest(np.array([0.0, 0.45]), REACH)
    with pytest.raises(ValueError, match=r"rest pose of 550 in dimension 1, whose poses are 0.5 to 0.6"):
        check_rest(np.array([0.0, 550.0]), REACH)
    still = measure_limits(np.full((3, 2), 0.5))
    still.check(np.full((4, 2), 0.501), None, {})
    check_rest(np.full(2, 0.5), still)


def test_poses_of_no_face() -> None:
    for low, high, closed in (
        ([-40.0, 0.5], [60.0, 0.6], 0.0),
        ([90.0, 0.5], [91.0, 0.6], 0.0),
        ([-60.0, 0.5], [0.0, 0.6], 0.0),
        ([0.0, 0.5], [0.3, 0.6], 20.0),
        ([0.0, 0.5], [0.3, 1e5], 0.0),
    ):
        with pytest.raises(ValueError, match=r"opening|width"):
            check_poses(MotionLimits(np.array(low), np.array(high)), FACE, Closure(0, closed, np.zeros(2)))


def test_each_unit_has_its_largest_value() -> None:
    for unit, largest in ((WEIGHT, 255), (GREY, 1e5), ("mm", 1e6)):
        high = np.array([largest, 0.6])
        check_poses(MotionLimits(REACH.low, high), space(unit, unit), None)
        with pytest.raises(ValueError, match="'opening' goes from 0 to"):
            check_poses(MotionLimits(REACH.low, high * 1.01), space(unit, unit), None)


def test_points_far_from_the_face() -> None:
    near, far = (
        MotionSpace((Channel("x_1"), Channel("y_1")), np.array([], int), Pca(np.array(mean), np.eye(2)))
        for mean in ([0.3, -1.2], [300.0, -1200.0])
    )
    check_poses(REACH, near, None)
    with pytest.raises(ValueError, match=r"points_mean as large as 1200 of points that move by 0.3"):
        check_poses(REACH, far, None)


def test_poses_lie_as_far_apart_as_their_deviations_let_them() -> None:
    variances = np.full(POSES.shape, 0.01**2)
    check_spread(POSES, variances)
    with pytest.raises(ValueError, match=r"means that span \d+ of their deviations, required at most 1000"):
        check_spread(POSES * 1000, variances)


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


def test_closures_can_be_left_to_the_model_and_what_is_pinned_does_not_follow_them():
    pure = engine_named("trajectory", {"closures": False})
    talk = speech(spoken(("aa", "p", "aa"), (12, 3, 12)))
    free, closed = (engine.generate(MODEL, talk).motion["opening"] for engine in (pure, ENGINE))
    frames = find_closable_ranges(talk.units, len(free))[0]
    assert free[frames].min() > MODEL.closure.closed
    assert closed[frames].min() <= MODEL.closure.closed
    for channel, value in (("width", 0.5), ("opening", 0.3)):
        pinned = ENGINE.generate(MODEL, talk, Constraints((Pin(0.62, channel, value),))).motion
        assert pinned[channel][62] == value


def test_spans_reach_two_frames_beyond_the_phone_and_stay_inside():
    units = Timeline((Span(0.0, 0.05, Unit("p")), Span(0.1, 0.15, Unit("aa")), Span(0.995, 1.01, Unit("m"))))
    assert find_closable_ranges(units, 101) == [slice(0, 8), slice(98, 101)]
    assert find_closable_ranges(units, 90) == [slice(0, 8)]
    syllabic = Timeline((Span(0.1, 0.2, Unit("em")), Span(0.2, 0.3, Unit("en"))))  # only an em closes
    assert len(find_closable_ranges(syllabic, 50)) == 1


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
    seen = np.ones(60, bool)
    closure = estimate_closure([x], [seen], [units], column=0)
    assert closure.closed == 0.02
    assert closure.follow == pytest.approx([1, -2])
    seen[5:25] = False
    assert estimate_closure([x], [seen], [units], column=0).closed == pytest.approx((0.02 + 0.05) / 2)
    x[:, 0] -= 0.1  # a spline through the camera's frames may swing below zero; the lips cannot
    assert estimate_closure([x], [seen], [units], column=0).closed == 0
    vowel, line = Timeline((Span(0.0, 1.0, Unit("aa")),)), np.linspace(0, 1, 101)[:, None]
    without = estimate_closure([line], [np.ones(101, bool)], [vowel], column=0)
    assert without.closed == pytest.approx(0.02)  # the second percentile, without p, b or m


def test_lips_that_a_wrong_phone_shows_open_are_closed_as_far_as_the_frames_say():
    rng = np.random.default_rng(0)
    frames = np.concatenate([rng.uniform(0.0, 0.01, 40), rng.uniform(0.05, 0.2, 960)])
    assert estimate_closed_opening([0.126], frames) <= 0.01
    assert estimate_closed_opening([], frames) <= 0.01
    assert estimate_closed_opening([0.003, 0.004, 0.005], frames) == 0.004
    assert estimate_closed_opening([0.126], frames + 0.1, frames) == estimate_closed_opening([0.126], frames)
    assert estimate_closed_opening([-0.02], frames) == 0
    assert estimate_closed_opening([], np.empty(0)) == 0
