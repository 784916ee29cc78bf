import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.measures.curves import (
    correlation,
    global_variance_ratio,
    jerk_ratio,
    lag_ms,
    landmark_distance,
    lip_vertex_error,
    mean_distance,
    modulation_distance_db,
    normalised_rmse,
    per_clip_correlation,
    pooled_correlation,
    rmse,
    select_moving,
    upper_face_deviation,
)

SEEDS = st.integers(0, 2**32 - 1)


def clips(seed: int, count: int = 3, channels: int = 2) -> list[np.ndarray]:
    draw = np.random.default_rng(seed)
    return [np.cumsum(draw.normal(0, 1, (int(draw.integers(40, 90)), channels)), axis=0) for _ in range(count)]


def column(*values: float) -> np.ndarray:
    return np.array(values, float)[:, None]


@given(seed=SEEDS, gain=st.floats(0.1, 10), offset=st.floats(-5, 5))
@settings(max_examples=25)
def test_correlation_is_one_with_itself_whatever_the_scale(seed, gain, offset):
    x = clips(seed, 1)[0]
    assert correlation(gain * x + offset, x) == pytest.approx([1, 1])
    assert correlation(-gain * x, x) == pytest.approx([-1, -1])


@given(seed=SEEDS)
@settings(max_examples=25)
def test_correlation_is_that_of_numpy(seed):
    one, two = clips(seed, 1)[0], clips(seed + 1, 1)[0]
    count = min(len(one), len(two))
    wanted = [np.corrcoef(one[:count, c], two[:count, c])[0, 1] for c in range(2)]
    assert correlation(one[:count], two[:count]) == pytest.approx(wanted)


@given(value=st.floats(-1, 1), other=st.floats(-1, 1), frames=st.integers(1, 80))
def test_a_constant_correlates_with_nothing(value, other, frames):
    flat, line = np.full((frames, 1), value), np.linspace(0, 1, frames)[:, None]
    for one, two in ((flat, np.full((frames, 1), other)), (flat, line), (line, flat)):
        assert correlation(one, two)[0] == 0


def test_pooled_means_are_those_of_all_frames_and_per_clip_of_each():
    """Two clips with correlation 1 each, at two rest poses, one of which is generated wrong."""
    original = [column(0, 1, 0, 1), column(10, 11, 10, 11)]
    generated = [column(0, 1, 0, 1), column(0, 1, 0, 1)]
    assert per_clip_correlation(generated, original)[0] == pytest.approx(1)
    a, b = np.concatenate(generated)[:, 0], np.concatenate(original)[:, 0]
    assert pooled_correlation(generated, original)[0] == pytest.approx(np.corrcoef(a, b)[0, 1])
    assert pooled_correlation(generated, original)[0] < 0.2


def test_distance_is_the_mean_norm_not_its_square():
    generated = [np.array([[3.0, 4.0], [0.0, 0.0]]), np.array([[0.0, 1.0]])]
    original = [np.zeros((2, 2)), np.zeros((1, 2))]
    assert mean_distance(generated, original) == pytest.approx((5 + 0 + 1) / 3)


def test_error_is_in_units_of_the_channels_deviation():
    original = [column(0, 2), column(0, 2)]
    generated = [column(1, 2), column(0, 3)]
    assert normalised_rmse(generated, original)[0] == pytest.approx(np.sqrt(2 / 4) / 1)
    assert rmse(generated, original)[0] == pytest.approx(np.sqrt(2 / 4))


@given(seed=SEEDS)
@settings(max_examples=10)
def test_predicting_the_mean_is_an_error_of_one_and_a_range_of_none(seed):
    original = clips(seed)
    flat = [np.tile(np.concatenate(original).mean(axis=0), (len(clip), 1)) for clip in original]
    assert normalised_rmse(flat, original) == pytest.approx([1, 1])
    assert global_variance_ratio(flat, original) == pytest.approx([0, 0], abs=1e-12)


def test_range_is_the_ratio_of_mean_deviations():
    original = [column(0, 2), column(0, 6)]  # deviations 1 and 3
    generated = [column(5, 6), column(9, 10)]  # ½ each
    assert global_variance_ratio(generated, original)[0] == pytest.approx(0.5 / 2)


@given(seed=SEEDS, gain=st.floats(0.1, 5))
@settings(max_examples=10)
def test_scaling_scales_range_and_jerk(seed, gain):
    original = clips(seed)
    scaled = [gain * clip + 3 for clip in original]
    for ratio in (global_variance_ratio, jerk_ratio):
        assert ratio(original, original) == pytest.approx([1, 1])
        assert ratio(scaled, original) == pytest.approx([gain, gain])


def test_jerk_by_hand_never_looks_across_clips():
    original = [column(0, 0, 0, 1), column(100, 100, 100, 102), column(7, 8, 9)]  # third differences 1 and 2, none
    generated = [column(0, 0, 1, 0, 0), column(5, 5, 5, 5), column(0, 50, 0)]  # 3, 3 and 0
    assert jerk_ratio(generated, original)[0] == pytest.approx(2 / 1.5)


def smooth(seed: int, frames: int) -> np.ndarray:
    draw = np.random.default_rng(seed)
    return np.convolve(draw.normal(0, 1, frames + 60), np.hanning(9), "same")


@given(seed=SEEDS, late=st.integers(-8, 8), rate_hz=st.sampled_from([25.0, 29.97, 100.0]))
@settings(max_examples=30)
def test_lag_is_the_shift_and_late_is_positive(seed, late, rate_hz):
    curves = [smooth(seed, 120), smooth(seed + 1, 90)]
    original = [curve[30:-30, None] for curve in curves]
    generated = [curve[30 - late : len(curve) - 30 - late, None] for curve in curves]
    assert lag_ms(generated, original, rate_hz) == pytest.approx(1000 * late / rate_hz, abs=0.1 * 1000 / rate_hz)


def test_lag_between_frames_of_the_first_channel():
    time_s = np.arange(200) / 25
    original = np.stack([np.sin(4 * time_s), np.zeros(200)], axis=1)
    generated = np.stack([np.sin(4 * (time_s - 0.013)), np.arange(200.0)], axis=1)
    assert lag_ms([generated], [original], 25.0) == pytest.approx(13, abs=1.5)


def test_channels_that_move():
    """They are compared with channels of the same unit, over all clips together."""
    wave = np.sin(np.arange(50) / 5)[:, None]
    clips = [wave * (1, 0.5, 0.009, 0, 90) + (0, 0, 0, 7, 0), np.tile([0, 0, 0, 7, 0.0], (9, 1))]
    assert select_moving(clips, ["m", "m", "m", "m", "degrees"]).tolist() == [True, True, False, False, True]
    assert select_moving([wave * (1e-9, 0)], ["m", "degrees"]).tolist() == [True, False]
    steps = [np.full((5, 1), 1.0), np.full((5, 1), 2.0)]
    assert select_moving(steps, ["m"]).tolist() == [True]


def test_a_constant_with_rounding_is_a_constant():
    for value in (1e-3, 0.3, 1e4):
        rng = np.random.default_rng(0)
        wave = rng.normal(size=(200, 1))
        still = value * (1 + 1e-8 * wave)
        assert correlation(still, wave) == 0
        assert correlation(wave, still) == 0
        assert not select_moving([still], ["a"]).any()
        for measure in (normalised_rmse, global_variance_ratio, jerk_ratio):
            assert np.isnan(measure([wave], [still])).all()
            assert np.isfinite(measure([still], [wave])).all()


TIME_S = np.arange(200) / 25
WAVES = np.stack([np.sin(2 * np.pi * 3 * TIME_S), np.sin(2 * np.pi * 7 * TIME_S)], axis=1)


def test_half_the_movement_is_six_decibels_at_every_frequency_whatever_moves_when() -> None:
    noise = np.random.default_rng(0).normal(size=(200, 1))
    assert modulation_distance_db([noise / 2], [noise], 25.0) == pytest.approx([20 * np.log10(2)])
    assert modulation_distance_db([noise[::-1]], [noise], 25.0) == pytest.approx([0.0], abs=1.0)


def test_movement_at_another_frequency_is_far_away() -> None:
    assert (modulation_distance_db([WAVES[:, ::-1]], [WAVES], 25.0) > 10).all()
    faster = WAVES[:, :1] + 0.2 * np.sin(2 * np.pi * 30 * np.arange(800) / 100)[::4, None]
    assert modulation_distance_db([faster], [WAVES[:, :1]], 25.0) > 1


def test_a_channel_that_does_not_move_has_no_distance_and_one_that_should_move_a_finite_one() -> None:
    flat = np.zeros((200, 1))
    assert np.isnan(modulation_distance_db([WAVES[:, :1]], [flat], 25.0)).all()
    assert 20 < modulation_distance_db([flat], [WAVES[:, :1]], 25.0)[0] < 60


def test_frequencies_above_speech_do_not_count() -> None:
    time_s = np.arange(800) / 100
    slow = np.random.default_rng(0).normal(size=(80, 1)).repeat(10, axis=0)
    nervous = slow + np.sin(2 * np.pi * 40 * time_s)[:, None]
    assert modulation_distance_db([nervous], [slow], 100.0) == pytest.approx([0.0], abs=0.1)


STILL = np.zeros((4, 3, 3))


def test_the_worst_vertex_of_every_frame_counts_and_the_mean_over_frames() -> None:
    made = STILL.copy()
    made[0, 1] = (3, 0, 4)
    made[0, 2] = (0, 1, 0)
    made[1, 0] = (0, 0, 2)
    assert lip_vertex_error([made], [STILL]) == pytest.approx((5 + 2) / 4)
    assert lip_vertex_error([made, STILL[:2]], [STILL, STILL[:2]]) == pytest.approx((5 + 2) / 6)  # frames, not clips
    assert landmark_distance([made], [STILL]) == pytest.approx((5 + 1 + 2) / 12)


def test_upper_face_deviation_is_how_much_more_the_original_varies_about_its_rest() -> None:
    rest = np.array([[0.0, 1.0, 0.0], [0.0, 2.0, 0.0]])
    original = np.repeat(rest[None], 4, axis=0)
    original[:, 0, 1] += (0, 2, 0, 2)  # deviates by 1 from its mean
    made = np.repeat(rest[None], 4, axis=0)
    made[:, 0, 2] += (0, -1, 0, -1)  # by a half, elsewhere
    assert upper_face_deviation([made], [original], rest) == pytest.approx((1 - 0.5) / 2)
    assert upper_face_deviation([original], [made], rest) == pytest.approx(-(1 - 0.5) / 2)
    raised = made + np.array([0, 0.5, 0])  # a face that is held otherwise does not vary
    assert upper_face_deviation([raised[:, 1:]], [made[:, 1:]], rest[1:]) == pytest.approx(0)
