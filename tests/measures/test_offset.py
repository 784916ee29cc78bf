import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from lipmotion.measures.curves import MIN_CLIPS, MIN_SCORE, best_offset, pooled_offset, shift_scores

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
    found = best_offset(scores(late_frames, seed), RATE_HZ)
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


def test_frames_without_a_face_do_not_count() -> None:
    valid = np.ones(300, bool)
    valid[80:140] = False
    measured = wave(0)
    measured[80:140] = 1e3
    assert best_offset(shift_scores(wave(-7), measured, valid, REACH), RATE_HZ).late_s == pytest.approx(0.07, abs=0.001)


def test_unlike_curves_are_not_known() -> None:
    found = [
        best_offset(shift_scores(wave(0, seed=n), wave(0, seed=n + 50), np.ones(300, bool), REACH), RATE_HZ)
        for n in range(20)
    ]
    assert sum(each.known for each in found) <= 4


def test_a_repeating_curve_is_not_known() -> None:
    time_s = np.arange(300) / RATE_HZ
    beat = np.sin(2 * np.pi * 5 * time_s)
    found = best_offset(shift_scores(beat, beat, np.ones(300, bool), REACH), RATE_HZ)
    assert found.score > 0.9
    assert not found.known


def test_clips_together_know_better_than_each() -> None:
    clips = [scores(6.0, seed, noise=12.0) for seed in range(30)]
    found = pooled_offset(clips, RATE_HZ)
    worst_s = max(abs(best_offset(clip, RATE_HZ).late_s - 0.06) for clip in clips)
    assert abs(found.late_s - 0.06) < 0.01 < worst_s
    assert found.low_s <= found.late_s <= found.high_s
    assert found.low_s < 0.06 < found.high_s or found.high_s - found.low_s < 0.01


def test_clips_that_correlate_little_and_agree_are_known_together() -> None:
    """As those of a voice that the prediction has not learned: 0 of 13 are known alone."""
    clips = [scores(6.0, seed, noise=12.0) for seed in range(13)]
    assert not any(best_offset(clip, RATE_HZ).known for clip in clips)
    found = pooled_offset(clips, RATE_HZ)
    assert found.score < MIN_SCORE
    assert found.known
    assert not pooled_offset(clips[: MIN_CLIPS - 1], RATE_HZ).known
    others = [shift_scores(wave(0, seed=n), wave(0, seed=n + 50), np.ones(300, bool), REACH) for n in range(len(clips))]
    assert not pooled_offset(others, RATE_HZ).known
    assert found == pooled_offset(clips, RATE_HZ)


def test_clips_shorter_than_the_shifts() -> None:
    for count in (1, 5, 30, 40, 50, 80):
        curve = wave(0, count)
        found = shift_scores(curve, curve, np.ones(count, bool), REACH)
        assert found.shape == (2 * REACH + 1,)
        assert found[: max(REACH - count // 2, 0)] == pytest.approx(0)
        assert found[REACH] == pytest.approx(1 if count > 1 else 0)
