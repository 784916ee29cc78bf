from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.engines import engine_named
from lipmotion.errors import ModelFormatError
from lipmotion.kernels.banded import solve_mlpg
from lipmotion.motion import closure, space
from lipmotion.motion import generation as module
from lipmotion.motion.generation import LARGEST_FACTOR, VarianceScaling
from lipmotion.motion.modulation_filter import REACH as TAPS
from lipmotion.motion.modulation_filter import ModulationFilter
from lipmotion.stats.pca import Pca
from lipmotion.testing import PHONES, examples, speech, timeline
from lipmotion.types import GREY, WEIGHT, Channel, Constraints, Pin, Span, Timeline, Unit, silent_monitor
from meshes.speech import said

POSES = np.array([[0.0, 0.5], [0.3, 0.6], [0.1, 0.55]])
REACH = space.measure_limits(POSES)
CLOSURE = closure.Closure(0, 0.02, np.array([1.0, 0.2]))


def space_of(*units: str) -> space.MotionSpace:
    channels = tuple(Channel(name, unit) for name, unit in zip(("opening", "width"), units, strict=True))
    return space.MotionSpace(channels, np.arange(2), None)


FACE = space_of("eye_distance", "eye_distance")


def test_reach_is_what_poses_span() -> None:
    assert (REACH.low.tolist(), REACH.high.tolist()) == ([0.0, 0.5], [0.3, 0.6])
    wide = REACH.extend(np.array([0.1, 0.01]))
    assert wide.low == pytest.approx([-0.3, 0.47])
    assert wide.high == pytest.approx([0.6, 0.63])


@pytest.mark.parametrize(("value", "column"), [(7.0, 0), (-7.0, 1), (1e38, 1), (np.nan, 0), (np.inf, 1)])
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
    space.check_rest(np.array([0.0, 0.45]), REACH)
    with pytest.raises(ValueError, match=r"rest pose of 550 in dimension 1, whose poses are 0.5 to 0.6"):
        space.check_rest(np.array([0.0, 550.0]), REACH)
    still = space.measure_limits(np.full((3, 2), 0.5))
    still.check(np.full((4, 2), 0.501), None, {})
    space.check_rest(np.full(2, 0.5), still)


def test_poses_of_no_face() -> None:
    for low, high, closed in ((-40, 60, 0), (90, 91, 0), (-60, 0, 0), (0, 0.3, 20)):
        limits = space.MotionLimits(np.array([low, 0.5]), np.array([high, 0.6]))
        with pytest.raises(ValueError, match=r"opening|width"):
            space.check_poses(limits, FACE, closure.Closure(0, closed, np.zeros(2)))
    with pytest.raises(ValueError, match=r"opening|width"):
        space.check_poses(space.MotionLimits(REACH.low, np.array([0.3, 1e5])), FACE, CLOSURE)


def test_each_unit_has_its_largest_value() -> None:
    for unit, largest in ((WEIGHT, 255), (GREY, 1e5), ("mm", 1e6)):
        high = np.array([largest, 0.6])
        space.check_poses(space.MotionLimits(REACH.low, high), space_of(unit, unit), None)
        with pytest.raises(ValueError, match="'opening' goes from 0 to"):
            space.check_poses(space.MotionLimits(REACH.low, high * 1.01), space_of(unit, unit), None)


def test_points_far_from_the_face() -> None:
    near, far = (
        space.MotionSpace((Channel("x_1"), Channel("y_1")), np.array([], int), Pca(np.array(mean), np.eye(2)))
        for mean in ([0.3, -1.2], [300.0, -1200.0])
    )
    space.check_poses(REACH, near, None)
    with pytest.raises(ValueError, match=r"points_mean as large as 1200 of points that move by 0.3"):
        space.check_poses(REACH, far, None)


def test_poses_lie_as_far_apart_as_their_deviations_let_them() -> None:
    variances = np.full(POSES.shape, 0.01**2)
    space.check_spread(POSES, variances)
    with pytest.raises(ValueError, match=r"means that span \d+ of their deviations, required at most 1000"):
        space.check_spread(POSES * 1000, variances)


ENGINE = engine_named("trajectory", {})
MODEL = ENGINE.fit(examples(), silent_monitor).model


def spoken(phones, durations) -> Timeline[Unit]:
    """Phones of given lengths (10 ms frames) between half seconds of silence."""
    edges = (np.cumsum([0, 50, *durations, 50]) / 100).tolist()
    return said(*zip(edges, edges[1:], ("sil", *phones, "sil"), strict=False))


PHONE = st.one_of(st.sampled_from("pbm"), st.sampled_from(PHONES[1:]))
SPOKEN = st.lists(st.tuples(PHONE, st.integers(2, 15)), min_size=1, max_size=8).map(
    lambda pairs: spoken(*zip(*pairs, strict=True))
)
PINS = st.lists(st.tuples(st.integers(40, 120), st.floats(0, 0.4)), max_size=3)


@given(units=SPOKEN, pins=PINS)
@settings(max_examples=20)
def test_the_lips_meet_in_every_p_b_and_m_that_the_user_left_alone(units, pins):
    talk = speech(units)
    wanted = [(frame, value) for frame, value in pins if frame < len(talk.features.values)]
    constraints = Constraints(tuple(Pin(frame / 100, "opening", value) for frame, value in wanted))
    opening = ENGINE.generate(MODEL, talk, constraints).motion["opening"]
    pinned = {frame for frame, _ in wanted}
    for frames in closure.find_closable_ranges(units, len(opening)):
        if not pinned & set(range(frames.start, frames.stop)):
            assert opening[frames].min() <= MODEL.closure.closed + 1e-12
    assert opening.min() >= 0


def test_closures_can_be_left_to_the_model_and_what_is_pinned_does_not_follow_them():
    pure = engine_named("trajectory", {"closures": False})
    talk = speech(spoken(("aa", "p", "aa"), (12, 3, 12)))
    free, closed = (engine.generate(MODEL, talk).motion["opening"] for engine in (pure, ENGINE))
    frames = closure.find_closable_ranges(talk.units, len(free))[0]
    assert free[frames].min() > MODEL.closure.closed
    assert closed[frames].min() <= MODEL.closure.closed
    for channel, value in (("width", 0.5), ("opening", 0.3)):
        pinned = ENGINE.generate(MODEL, talk, Constraints((Pin(0.62, channel, value),))).motion
        assert pinned[channel][62] == value


def test_spans_reach_two_frames_beyond_the_phone_and_stay_inside():
    units = said((0, 0.05, "p"), (0.1, 0.15, "aa"), (0.995, 1.01, "m"))
    assert closure.find_closable_ranges(units, 101) == [slice(0, 8), slice(98, 101)]
    assert closure.find_closable_ranges(units, 90) == [slice(0, 8)]
    assert len(closure.find_closable_ranges(said((0.1, 0.2, "em"), (0.2, 0.3, "en")), 50)) == 1  # only an em closes


def test_only_frames_that_do_not_close_anyway_are_chosen():
    ranges = closure.find_closable_ranges(said((0.1, 0.2, "p"), (0.3, 0.4, "b"), (0.5, 0.6, "m")), 80)
    opening = np.full(80, 0.2)
    opening[[15, 34, 55]] = 0.01, 0.06, 0.07
    lips = closure.Closure(0, 0.05, np.ones(1))
    assert closure.choose_closed_frames(lips, opening, ranges, []) == [34, 55]
    assert closure.choose_closed_frames(lips, opening, ranges, [52]) == [34]


def test_how_closed_is_the_median_of_the_least_openings():
    one = examples(1)[0]

    def fitted(x: np.ndarray, seen: np.ndarray, units: Timeline[Unit]) -> Any:
        return closure.fit_closure(
            ("opening",), [x], [replace(one, valid=seen, speech=replace(one.speech, units=units))]
        )

    units = said(*((0.1 * n, 0.1 * n + 0.1, "p" if n % 2 else "aa") for n in range(6)))
    x = np.full((60, 2), 0.3)
    x[[15, 35, 55], 0] = 0.01, 0.02, 0.05
    x[:, 1] = 1 - 2 * x[:, 0]
    lips = fitted(x, seen(60), units)
    assert lips.closed == 0.02
    assert lips.follow == pytest.approx([1, -2])
    hidden = (np.arange(60) < 5) | (np.arange(60) >= 25)
    assert fitted(x, hidden, units).closed == pytest.approx((0.02 + 0.05) / 2)
    x[:, 0] -= 0.1  # a spline through the camera's frames may swing below zero; the lips cannot
    assert fitted(x, hidden, units).closed == 0
    without = fitted(np.linspace(0, 1, 101)[:, None], seen(101), said((0, 1, "aa")))
    assert without.closed == pytest.approx(0.02)  # the second percentile, without p, b or m
    assert closure.fit_closure(("width",), [x], [one]) is None


def test_lips_that_a_wrong_phone_shows_open_are_closed_as_far_as_the_frames_say():
    rng = np.random.default_rng(0)
    frames = np.concatenate([rng.uniform(0.0, 0.01, 40), rng.uniform(0.05, 0.2, 960)])
    estimate = closure.estimate_closed_opening
    assert estimate([0.126], frames) <= 0.01
    assert estimate([], frames) <= 0.01
    assert estimate([0.003, 0.004, 0.005], frames) == 0.004
    assert estimate([0.126], frames + 0.1, frames) == estimate([0.126], frames)
    assert estimate([-0.02], frames) == 0
    assert estimate([], np.empty(0)) == 0


CHANNELS = tuple(map(Channel, ("x_1", "opening", "y_1", "jaw_open", "z_1")))


def motion(frames: int = 50) -> np.ndarray:
    return np.random.default_rng(1).normal(0.2, 1, (frames, 5)) * [1, 2, 0.5, 3, 0.1]


def test_distances_are_modelled_as_they_are_points_in_components_and_variance_is_carried_through():
    fitted = space.fit_space(CHANNELS, motion(), components=2)
    assert fitted.direct_names == ("opening", "jaw_open")
    assert fitted.reduce(motion()).shape == (50, 4)
    assert np.array_equal(fitted.reduce(motion())[:, :2], motion()[:, [1, 3]])
    values = fitted.restore(fitted.reduce(motion()))
    least = np.linalg.eigvalsh(np.cov(motion()[:, [0, 2, 4]].T, bias=True))[0]  # that any two components lose
    assert np.square(motion() - values).sum(axis=1).mean() == pytest.approx(least)
    variance = np.random.default_rng(2).uniform(0.1, 1, (1, 4))
    spread = variance @ fitted.mixing
    assert spread[0, [1, 3]] == pytest.approx(variance[0, :2])
    basis = fitted.points.basis
    assert spread[0, [0, 2, 4]] == pytest.approx(np.diag(basis.T @ np.diag(variance[0, 2:]) @ basis))


def seen(count: int) -> np.ndarray:
    return np.ones(count, bool)


@given(
    seed=st.integers(0, 2**32 - 1),
    rate_hz=st.sampled_from([24.0, 25.0, 29.97, 30.0, 50.0, 60.0]),
    count=st.integers(4, 40),
)
@settings(max_examples=30)
def test_a_cubic_comes_back_exactly(seed, rate_hz, count):
    cubic = np.polynomial.Polynomial(np.random.default_rng(seed).normal(0, 1, 4))
    camera_s = np.arange(count) / rate_hz
    frames = int(camera_s[-1] * 100) + 1
    values, valid = space.resample_to_model(cubic(camera_s)[:, None], seen(count), rate_hz, frames)
    assert values[:, 0] == pytest.approx(cubic(np.arange(frames) / 100), abs=1e-9)
    assert valid.all()


def test_frames_beyond_the_end_or_nearest_to_an_unseen_camera_frame_are_not_valid():
    values = np.arange(5.0)[:, None]
    curves, valid = space.resample_to_model(values, seen(5), 25.0, 30)
    assert curves[17:, 0] == pytest.approx(np.full(13, 4.0))  # the last value holds
    assert np.nonzero(~valid)[0].tolist() == [*range(18, 30)]  # the last camera frame is at 16; 18 is half a frame on
    _, valid = space.resample_to_model(values, np.array([True, True, False, True, True]), 25.0, 17)
    assert np.nonzero(~valid)[0].tolist() == [6, 7, 8, 9]


def test_one_and_two_camera_frames():
    for count, wanted in ((1, [7.0] * 9), (2, [7.0, 7.25, 7.5, 7.75, 8.0, 8.0, 8.0, 8.0, 8.0])):
        curves, valid = space.resample_to_model(np.array([[7.0], [8.0]])[:count], seen(count), 25.0, 9)
        assert curves[:, 0] == pytest.approx(wanted)
        assert valid.sum() == 4 * count - 2


SENTENCE = speech(timeline(["sil", *(list(PHONES) * 30)[:40], "sil"]), seed=5)
PINNED = Constraints((Pin(3.3, "opening", 0.2), Pin(5.01, "opening", 0.1)))
BEFORE = 5750  # frames of silence after which the sentence lies on the border of two blocks


def delayed():
    """Return the sentence and its pins after as much silence that it lies in two blocks."""
    assert BEFORE < module.BLOCK_FRAMES < BEFORE + 330
    units = Timeline((Span(0.0, BEFORE / 100, Unit("sil")), *SENTENCE.units.shifted(BEFORE / 100)))
    late = speech(units)
    values = np.concatenate([late.features.values[:BEFORE], SENTENCE.features.values])
    pins = Constraints(tuple(replace(pin, time_s=pin.time_s + BEFORE / 100) for pin in PINNED.pins))
    return replace(late, features=replace(late.features, values=values)), pins


def around(taps):
    reach = len(taps) // 2
    values = np.zeros((2 * TAPS + 1, MODEL.space.dimensions))
    values[TAPS - reach : TAPS + reach + 1] = np.array(taps)[:, None]
    return ModulationFilter(values)


@pytest.fixture(scope="module")
def whole():
    return ENGINE.generate(MODEL, SENTENCE, PINNED)


def test_blocks_change_nothing(whole):
    pieces, away = ENGINE.generate(MODEL, *delayed()), slice(100, None)
    moved = pieces.motion.values[BEFORE:]
    assert moved[away] == pytest.approx(whole.motion.values[away], abs=1e-7)  # a regression of single precision
    assert pieces.variance[BEFORE:][away] == pytest.approx(whole.variance[away], abs=1e-9)
    assert pieces.motion["opening"][BEFORE + 330] == 0.2
    names = [[each.trace.states[state] for state in each.trace.frames] for each in (pieces, whole)]
    assert names[0][BEFORE:][away] == names[1][away]


def test_the_filter_is_weaker_for_voices_that_are_less_known():
    learned = replace(MODEL.motion, modulation=around([-1.0, 3.0, -1.0]))
    assert learned.for_voice(1.0).modulation.taps == pytest.approx(learned.modulation.taps)
    assert replace(learned, modulation=None).for_voice(0.3).modulation is None
    assert learned.for_voice(0.75).modulation.taps[TAPS + 1] == pytest.approx(-0.5)  # unseen_share: one half
    unknown = learned.for_voice(0.0).modulation.taps
    assert unknown[TAPS] == pytest.approx(1)
    assert np.abs(unknown).sum(axis=0) == pytest.approx(1)


def test_the_modulation_filter_keeps_pins_closures_and_blocks(whole):
    model = replace(MODEL, modulation=around([-0.5, 0, 0, 2.0, 0, 0, -0.5]))  # sharpens
    filtered, plain = ENGINE.generate(model, SENTENCE, PINNED).motion["opening"], whole.motion["opening"]
    assert np.abs(np.diff(filtered, 3)).mean() > 1.5 * np.abs(np.diff(plain, 3)).mean()
    assert filtered[330] == 0.2
    assert filtered.min() >= 0
    ranges = closure.find_closable_ranges(SENTENCE.units, len(filtered))
    assert len(ranges) > 5
    for each in ranges:
        assert filtered[each].min() <= plain[each].min()
    late = ENGINE.generate(model, *delayed()).motion["opening"]
    assert late[BEFORE + 100 :] == pytest.approx(filtered[100:], abs=1e-7)


OPTIONS = {"articulation": False, "states": 3, "silent_states": 7, "components": 2, "acoustic_components": 20}


def test_the_trajectory_grows_about_rest_and_its_variance_with_it():
    draw = np.random.default_rng(0)
    means, precisions = draw.normal(size=(40, 3, 2)), draw.uniform(1, 9, (40, 3, 2))
    gain, rest = np.array([1.5, 1.0]), np.array([0.3, -1.0])
    plain, variance = solve_mlpg(means, precisions)
    large, larger_variance = solve_mlpg(*VarianceScaling(gain, rest).apply(means, precisions))
    assert large == pytest.approx(rest + gain * (plain - rest))
    assert larger_variance == pytest.approx(variance * gain * gain)


@pytest.fixture(scope="module")
def noisy_clips():
    """Clips in which every phone is said more or less wide, so that the mean of all is too small a movement."""
    corpus = examples(10)
    for number, one in enumerate(corpus):
        waves = np.sin(np.arange(len(one.valid)) / (3 + number % 4)) * 0.02
        one.motion.values[60:-60, 0] += waves[60:-60]
    return corpus


@pytest.mark.long
def test_the_full_range_is_nearer_to_the_original(noisy_clips):
    options = {**OPTIONS, "closures": False}
    engines = [engine_named("trajectory", {**options, "variance_scaling": on}) for on in (False, True)]
    learned = engines[0].fit(noisy_clips, silent_monitor).model
    assert 1 < learned.variance_factors[0] <= LARGEST_FACTOR
    made = [[engine.generate(learned, one.speech) for one in noisy_clips] for engine in engines]
    plain, full, original = (np.mean([one.motion["opening"].std() for one in each]) for each in (*made, noisy_clips))
    assert plain < full
    assert abs(full - original) < abs(plain - original)


def test_pins_and_rest_stay_where_they_are(noisy_clips):
    engine = engine_named("trajectory", OPTIONS)
    learned = engine.fit(noisy_clips, silent_monitor).model
    result = engine.generate(learned, speech(timeline(("t", "aa", "s"))), Constraints((Pin(0.8, "width", 0.61),)))
    assert result.motion["width"][80] == 0.61
    rest = learned.emission.means[-1, 0, 0]
    assert result.motion["opening"][:20] == pytest.approx(np.full(20, rest), abs=2e-3)
