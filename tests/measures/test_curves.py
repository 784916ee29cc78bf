import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from lipmotion.measures import closures, curves
from lipmotion_faces.corpus.sync import MIN_CLIPS, MIN_SCORE, find_offset, find_pooled_offset, shift_scores
from oracles import matching

SEEDS = st.integers(0, 2**32 - 1)


def clips(seed: int, count: int = 3, channels: int = 2) -> list[np.ndarray]:
    draw = np.random.default_rng(seed)
    return [np.cumsum(draw.normal(0, 1, (int(draw.integers(40, 90)), channels)), axis=0) for _ in range(count)]


def column(*values: float) -> np.ndarray:
    return np.array(values, float)[:, None]


@given(seed=SEEDS)
@settings(max_examples=25)
def test_correlation_is_that_of_numpy(seed):
    one, two = clips(seed, 1)[0], clips(seed + 1, 1)[0]
    count = min(len(one), len(two))
    wanted = [np.corrcoef(one[:count, c], two[:count, c])[0, 1] for c in range(2)]
    assert curves.correlation(one[:count], two[:count]) == pytest.approx(wanted)


def test_pooled_means_are_those_of_all_frames_and_per_clip_of_each():
    """Two clips with correlation 1 each, at two rest poses, one of which is generated wrong."""
    original = [column(0, 1, 0, 1), column(10, 11, 10, 11)]
    generated = [column(0, 1, 0, 1), column(0, 1, 0, 1)]
    assert curves.correlate_clips(generated, original)[0] == pytest.approx(1)
    a, b = np.concatenate(generated)[:, 0], np.concatenate(original)[:, 0]
    assert curves.correlate_pooled(generated, original)[0] == pytest.approx(np.corrcoef(a, b)[0, 1])
    assert curves.correlate_pooled(generated, original)[0] < 0.2


def test_distance_is_the_mean_norm_not_its_square():
    generated = [np.array([[3.0, 4.0], [0.0, 0.0]]), np.array([[0.0, 1.0]])]
    assert curves.measure_mean_distance(generated, [np.zeros((2, 2)), np.zeros((1, 2))]) == pytest.approx(
        (5 + 0 + 1) / 3
    )


def test_error_is_in_units_of_the_channels_deviation():
    original = [column(0, 2), column(0, 2)]
    generated = [column(1, 2), column(0, 3)]
    assert curves.measure_nrmse(generated, original)[0] == pytest.approx(np.sqrt(2 / 4) / 1)
    assert curves.rmse(generated, original)[0] == pytest.approx(np.sqrt(2 / 4))


def test_range_is_the_ratio_of_mean_deviations():
    original = [column(0, 2), column(0, 6)]  # deviations 1 and 3
    generated = [column(5, 6), column(9, 10)]  # ½ each
    assert curves.measure_variance_ratio(generated, original)[0] == pytest.approx(0.5 / 2)


@given(seed=SEEDS, gain=st.floats(0.1, 5))
@settings(max_examples=10)
def test_scaling_scales_range_and_jerk(seed, gain):
    original = clips(seed)
    scaled = [gain * clip + 3 for clip in original]
    for ratio in (curves.measure_variance_ratio, curves.measure_jerk_ratio):
        assert ratio(original, original) == pytest.approx([1, 1])
        assert ratio(scaled, original) == pytest.approx([gain, gain])


def test_jerk_by_hand_never_looks_across_clips():
    original = [column(0, 0, 0, 1), column(100, 100, 100, 102), column(7, 8, 9)]  # third differences 1 and 2, none
    generated = [column(0, 0, 1, 0, 0), column(5, 5, 5, 5), column(0, 50, 0)]  # 3, 3 and 0
    assert curves.measure_jerk_ratio(generated, original)[0] == pytest.approx(2 / 1.5)


def smooth(seed: int, frames: int) -> np.ndarray:
    return np.convolve(np.random.default_rng(seed).normal(0, 1, frames + 60), np.hanning(9), "same")


@given(seed=SEEDS, late=st.integers(-8, 8), rate_hz=st.sampled_from([25.0, 29.97, 100.0]))
@settings(max_examples=30)
def test_lag_is_the_shift_and_late_is_positive(seed, late, rate_hz):
    waves = [smooth(seed, 120), smooth(seed + 1, 90)]
    original = [curve[30:-30, None] for curve in waves]
    generated = [curve[30 - late : len(curve) - 30 - late, None] for curve in waves]
    assert curves.measure_lag(generated, original, rate_hz) == pytest.approx(
        1000 * late / rate_hz, abs=0.1 * 1000 / rate_hz
    )


def test_lag_between_frames_of_the_first_channel():
    time_s = np.arange(200) / 25
    original = np.stack([np.sin(4 * time_s), np.zeros(200)], axis=1)
    generated = np.stack([np.sin(4 * (time_s - 0.013)), np.arange(200.0)], axis=1)
    assert curves.measure_lag([generated], [original], 25.0) == pytest.approx(13, abs=1.5)


def test_channels_that_move():
    """They are compared with channels of the same unit, over all clips together."""
    wave = np.sin(np.arange(50) / 5)[:, None]
    clips = [wave * (1, 0.5, 0.009, 0, 90) + (0, 0, 0, 7, 0), np.tile([0, 0, 0, 7, 0.0], (9, 1))]
    assert curves.select_moving(clips, ["m", "m", "m", "m", "degrees"]).tolist() == [True, True, False, False, True]
    assert curves.select_moving([wave * (1e-9, 0)], ["m", "degrees"]).tolist() == [True, False]
    assert curves.select_moving([np.full((5, 1), 1.0), np.full((5, 1), 2.0)], ["m"]).tolist() == [True]


def test_a_constant_with_rounding_is_a_constant():
    for value in (1e-3, 0.3, 1e4):
        wave = np.random.default_rng(0).normal(size=(200, 1))
        still = value * (1 + 1e-8 * wave)
        assert curves.correlation(still, wave) == 0
        assert curves.correlation(wave, still) == 0
        assert not curves.select_moving([still], ["a"]).any()
        for measure in (curves.measure_nrmse, curves.measure_variance_ratio, curves.measure_jerk_ratio):
            assert np.isnan(measure([wave], [still])).all()
            assert np.isfinite(measure([still], [wave])).all()


TIME_S = np.arange(200) / 25
WAVES = np.stack([np.sin(2 * np.pi * 3 * TIME_S), np.sin(2 * np.pi * 7 * TIME_S)], axis=1)


def test_half_the_movement_is_six_decibels_at_every_frequency_and_at_another_one_far_away() -> None:
    noise = np.random.default_rng(0).normal(size=(200, 1))
    assert curves.measure_modulation_distance([noise / 2], [noise], 25.0) == pytest.approx([20 * np.log10(2)])
    assert curves.measure_modulation_distance([noise[::-1]], [noise], 25.0) == pytest.approx([0.0], abs=1.0)
    assert (curves.measure_modulation_distance([WAVES[:, ::-1]], [WAVES], 25.0) > 10).all()
    faster = WAVES[:, :1] + 0.2 * np.sin(2 * np.pi * 30 * np.arange(800) / 100)[::4, None]
    assert curves.measure_modulation_distance([faster], [WAVES[:, :1]], 25.0) > 1


def test_a_channel_that_does_not_move_or_above_speech_has_no_distance_and_one_that_should_a_finite_one() -> None:
    flat = np.zeros((200, 1))
    assert np.isnan(curves.measure_modulation_distance([WAVES[:, :1]], [flat], 25.0)).all()
    assert 20 < curves.measure_modulation_distance([flat], [WAVES[:, :1]], 25.0)[0] < 60
    time_s = np.arange(800) / 100
    slow = np.random.default_rng(0).normal(size=(80, 1)).repeat(10, axis=0)
    nervous = slow + np.sin(2 * np.pi * 40 * time_s)[:, None]
    assert curves.measure_modulation_distance([nervous], [slow], 100.0) == pytest.approx([0.0], abs=0.1)


STILL = np.zeros((4, 3, 3))


def test_the_worst_vertex_of_every_frame_counts_and_the_mean_over_frames() -> None:
    made = STILL.copy()
    made[0, 1] = (3, 0, 4)
    made[0, 2] = (0, 1, 0)
    made[1, 0] = (0, 0, 2)
    assert curves.measure_lip_error([made], [STILL]) == pytest.approx((5 + 2) / 4)
    assert curves.measure_lip_error([made, STILL[:2]], [STILL, STILL[:2]]) == pytest.approx(
        (5 + 2) / 6
    )  # frames, not clips
    assert curves.measure_landmarks([made], [STILL]) == pytest.approx((5 + 1 + 2) / 12)


def test_upper_face_deviation_is_how_much_more_the_original_varies_about_its_rest() -> None:
    rest = np.array([[0.0, 1.0, 0.0], [0.0, 2.0, 0.0]])
    original = np.repeat(rest[None], 4, axis=0)
    original[:, 0, 1] += (0, 2, 0, 2)  # deviates by 1 from its mean
    made = np.repeat(rest[None], 4, axis=0)
    made[:, 0, 2] += (0, -1, 0, -1)  # by a half, elsewhere
    assert curves.measure_upper_face([made], [original], rest) == pytest.approx((1 - 0.5) / 2)
    assert curves.measure_upper_face([original], [made], rest) == pytest.approx(-(1 - 0.5) / 2)
    raised = made + np.array([0, 0.5, 0])  # a face that is held otherwise does not vary
    assert curves.measure_upper_face([raised[:, 1:]], [made[:, 1:]], rest[1:]) == pytest.approx(0)


def acc(generated, original) -> float:
    return float(curves.correlate_pooled(generated, original)[0])


@given(seed=st.integers(0, 10_000))
@settings(max_examples=10)
def test_the_interval_holds_the_figure_itself(seed):
    draw = np.random.default_rng(seed)
    original = [draw.normal(0, 1, (40, 1)) for _ in range(12)]
    generated = [clip + draw.normal(0, 0.7, clip.shape) for clip in original]
    low, high = curves.compute_interval(acc, generated, original, seed=0, draws=200)
    assert low < acc(generated, original) < high
    assert high - low < 0.3


def test_clips_are_drawn_whole_and_together():
    """Every clip has its own value, generated and original alike, so clips that were drawn separately would differ."""
    values = [np.full((3, 1), float(n)) for n in range(5)]
    assert curves.compute_interval(curves.measure_mean_distance, values, values, seed=0, draws=50) == (0, 0)


RATE_HZ = 100.0
REACH = 40


def wave(start: float, count: int = 300, seed: int = 0) -> NDArray[np.float64]:
    """Return a band-limited random curve, from any start on."""
    draw = np.random.default_rng(seed)
    time = start + np.arange(count)
    return sum(
        np.sin(2 * np.pi * hertz / RATE_HZ * time + phase)
        for hertz, phase in zip(draw.uniform(0.5, 7, 25), draw.uniform(0, 6.3, 25), strict=True)
    )


def scores(late_frames: float, seed: int = 0, noise: float = 0.0, valid: NDArray[np.bool_] | None = None):
    measured = wave(0, seed=seed) + noise * np.random.default_rng(seed).normal(size=300)
    valid = np.ones(300, bool) if valid is None else valid
    return shift_scores(wave(-late_frames, seed=seed), measured, valid, REACH)


@settings(max_examples=40)
@given(st.floats(-30, 30), st.integers(0, 20))
def test_a_shift_is_found(late_frames: float, seed: int) -> None:
    found = find_offset(scores(late_frames, seed), RATE_HZ)
    assert found.late_s == pytest.approx(late_frames / RATE_HZ, abs=0.002)
    assert found.known
    assert found.low_s == found.late_s == found.high_s


def test_scores_are_plain_correlations() -> None:
    draw = np.random.default_rng(1)
    predicted, measured, valid = draw.normal(size=60), draw.normal(size=50), draw.random(50) > 0.2
    found = shift_scores(predicted, measured, valid, 12)
    for shift in range(-12, 13):
        pairs = [(predicted[t + shift], measured[t]) for t in range(50) if valid[t] and 0 <= t + shift < 60]
        expected = np.corrcoef(np.array(pairs).T)[0, 1]
        assert found[shift + 12] == pytest.approx(expected if len(pairs) >= 25 else 0)


def test_clips_together_know_better_than_each_also_where_none_is_known_alone() -> None:
    """Also those of a voice that the prediction has not learned: 0 of 13 are known alone."""
    clips = [scores(6.0, seed, noise=12.0) for seed in range(30)]
    found = find_pooled_offset(clips, RATE_HZ)
    worst_s = max(abs(find_offset(clip, RATE_HZ).late_s - 0.06) for clip in clips)
    assert abs(found.late_s - 0.06) < 0.01 < worst_s
    assert found.low_s <= found.late_s <= found.high_s
    assert found.low_s < 0.06 < found.high_s or found.high_s - found.low_s < 0.01
    clips = clips[:13]
    assert not any(find_offset(clip, RATE_HZ).known for clip in clips)
    found = find_pooled_offset(clips, RATE_HZ)
    assert found.score < MIN_SCORE
    assert found.known
    assert not find_pooled_offset(clips[: MIN_CLIPS - 1], RATE_HZ).known
    others = [shift_scores(wave(0, seed=n), wave(0, seed=n + 50), np.ones(300, bool), REACH) for n in range(len(clips))]
    assert not find_pooled_offset(others, RATE_HZ).known
    assert found == find_pooled_offset(clips, RATE_HZ)


FRAMES = st.lists(st.integers(0, 14), max_size=5, unique=True).map(lambda frames: np.array(sorted(frames), np.intp))


def opening(closed: list[int], frames: int = 30) -> np.ndarray:
    """Return an opening of 1, and of 0 (closed) in given frames."""
    curve = np.ones(frames)
    curve[closed] = 0
    return curve


def test_a_closing_is_the_first_frame_under_a_tenth_of_the_95th_percentile_after_an_open_one():
    curve = np.array([0.0, 0.0, 1.0, 0.05, 0.0, 1.0, 1.0, 0.0])
    assert closures.find_closings(curve, 0.1).tolist() == [3, 7]  # closed from the start is no closing
    assert closures.find_closings(curve, 0.05).tolist() == [4, 7]  # the threshold itself is open
    assert closures.find_closings(curve[:1], 0.1).tolist() == []
    openings = [np.linspace(0, 1, 101), np.linspace(0, 1, 101)]
    assert closures.find_threshold(openings) == pytest.approx(0.095, abs=1e-3)
    assert closures.find_threshold(openings, share=0.25) == pytest.approx(0.2375, abs=1e-3)


@given(generated=FRAMES, original=FRAMES)
@settings(max_examples=60)
def test_as_many_as_possible_are_matched_one_to_one_at_the_least_distance(generated, original):
    pairs = closures.match_closings(generated, original)
    assert len({g for g, _ in pairs}) == len({o for _, o in pairs}) == len(pairs)
    assert all(abs(g - o) <= 2 for g, o in pairs)
    distance = sum(abs(g - o) for g, o in pairs)
    assert (len(pairs), distance) == matching.best(generated.tolist(), original.tolist(), 2)


def test_matching_by_hand():
    for generated, original, pairs in (
        ([8, 11], [10], [(11, 10)]),
        ([7], [10], []),
        ([9, 12], [10, 11], [(9, 10), (12, 11)]),
        ([10, 12], [8, 10], [(10, 8), (12, 10)]),  # nearest first finds one
    ):
        assert closures.match_closings(np.array(generated), np.array(original)) == pairs
    assert closures.match_closings(np.array([10, 12]), np.array([11])) in ([(10, 11)], [(12, 11)])


@given(some=FRAMES, others=FRAMES)
def test_near_counts_whichever_is_near(some, others):
    assert closures.count_matches(some, others) == sum(any(abs(a - b) <= 2 for b in others) for a in some)


def test_figures_by_hand():
    original, generated = [opening([5, 12, 20]), opening([3])], [opening([7, 20, 27]), opening([10])]
    figures = closures.measure_closures(generated, original, 0.1, 25.0)
    assert (figures.score, figures.precision, figures.f1) == pytest.approx((2 / 4, 2 / 4, 2 * 2 / (4 + 4)))
    assert figures.timing_ms == pytest.approx(1000 * 1 / 25)  # the median of 2 frames late and on time
    assert (figures.original, figures.generated) == (4, 4)
    figures = closures.measure_closures([opening([11])], [opening([10, 12])], 0.1, 25.0)
    assert (figures.score, figures.precision) == (1, 1)  # Hofer's: a point for every original that has one near it
    assert figures.f1 == pytest.approx(2 / 3)  # matched once
    assert abs(figures.timing_ms) == pytest.approx(40)


def test_a_mouth_that_never_moves_has_no_figures():
    flat = [np.ones(20)]
    figures = closures.measure_closures(flat, flat, 0.1, 25.0)
    assert (figures.original, figures.generated) == (0, 0)
    assert np.isnan([figures.score, figures.precision, figures.f1, figures.timing_ms]).all()
    lost = closures.measure_closures(flat, [opening([5], 20)], 0.1, 25.0)
    assert lost.score == lost.f1 == 0
    assert np.isnan(lost.precision)


def test_phone_closures_by_hand():
    """25 fps; the phones last from frame 5 to 7, 15 to 17 and 24 to 26, each with a frame before and after."""
    phones = [[(0.2, 0.28), (0.6, 0.68), (0.96, 1.04)]]
    original = [opening([6, 14, 20])]  # closes in the first, one frame ahead of the second, and elsewhere
    generated = [opening([8, 12, 25])]  # one frame behind the first, misses the second; the third does not count
    figures = closures.measure_phones(generated, original, phones, speech_s=30.0, threshold=0.1, rate_hz=25.0)
    assert figures.intervals == 2
    assert figures.recall == pytest.approx(1 / 2)
    assert figures.false_per_minute == pytest.approx(1 / 0.5)  # frame 12
    assert figures.original_per_minute == pytest.approx(1 / 0.5)  # frame 20


def test_intervals_are_taken_one_frame_longer_at_both_ends():
    """The frames at 0.20, 0.24 and 0.28 s lie inside, so 4 to 8 count."""
    for interval_s in ((0.2, 0.28), (0.165, 0.315)):
        for frame in range(30):
            figures = closures.measure_phones([opening([frame])], [opening([frame])], [[interval_s]], 60.0, 0.1, 25.0)
            assert figures.intervals == (4 <= frame <= 8)
            assert figures.false_per_minute == (not 4 <= frame <= 8 and frame > 0)  # closed from the start is none


def test_phones_beyond_the_clip_and_clips_without_phones():
    openings = [opening([6]), opening([29])]
    figures = closures.measure_phones(openings, openings, [[], [(1.16, 1.4), (2.0, 2.1)]], 60.0, 0.1, 25.0)
    assert (figures.recall, figures.intervals) == (1, 1)
    assert figures.false_per_minute == 1
    nothing = closures.measure_phones(openings, openings, [[], []], 0.0, 0.1, 25.0)
    assert np.isnan([nothing.recall, nothing.false_per_minute, nothing.original_per_minute]).all()
