import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.measures import closures
from oracles import matching

FRAMES = st.lists(st.integers(0, 14), max_size=5, unique=True).map(lambda frames: np.array(sorted(frames), np.intp))


def opening(closed: list[int], frames: int = 30) -> np.ndarray:
    """Return an opening of 1, and of 0 (closed) in given frames."""
    curve = np.ones(frames)
    curve[closed] = 0
    return curve


def test_threshold_is_a_tenth_of_the_95th_percentile_of_all_frames():
    curves = [np.linspace(0, 1, 101), np.linspace(0, 1, 101)]
    assert closures.closed_threshold(curves) == pytest.approx(0.095, abs=1e-3)
    assert closures.closed_threshold(curves, share=0.25) == pytest.approx(0.2375, abs=1e-3)


def test_a_closing_is_the_first_closed_frame_after_an_open_one():
    curve = np.array([0.0, 0.0, 1.0, 0.05, 0.0, 1.0, 1.0, 0.0])
    assert closures.find_closings(curve, 0.1).tolist() == [3, 7]  # closed from the start is no closing
    assert closures.find_closings(curve, 0.05).tolist() == [4, 7]  # the threshold itself is open
    assert closures.find_closings(curve[:1], 0.1).tolist() == []


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
    figures = closures.closure_figures(generated, original, 0.1, 25.0)
    assert (figures.score, figures.precision, figures.f1) == pytest.approx((2 / 4, 2 / 4, 2 * 2 / (4 + 4)))
    assert figures.timing_ms == pytest.approx(1000 * 1 / 25)  # the median of 2 frames late and on time
    assert (figures.original, figures.generated) == (4, 4)
    figures = closures.closure_figures([opening([11])], [opening([10, 12])], 0.1, 25.0)
    assert (figures.score, figures.precision) == (1, 1)  # Hofer's: a point for every original that has one near it
    assert figures.f1 == pytest.approx(2 / 3)  # matched once
    assert abs(figures.timing_ms) == pytest.approx(40)


def test_a_mouth_that_never_moves_has_no_figures():
    flat = [np.ones(20)]
    figures = closures.closure_figures(flat, flat, 0.1, 25.0)
    assert (figures.original, figures.generated) == (0, 0)
    assert np.isnan([figures.score, figures.precision, figures.f1, figures.timing_ms]).all()
    lost = closures.closure_figures(flat, [opening([5], 20)], 0.1, 25.0)
    assert lost.score == lost.f1 == 0
    assert np.isnan(lost.precision)


def test_phone_closures_by_hand():
    """25 fps; the phones last from frame 5 to 7, 15 to 17 and 24 to 26, each with a frame before and after."""
    phones = [[(0.2, 0.28), (0.6, 0.68), (0.96, 1.04)]]
    original = [opening([6, 14, 20])]  # closes in the first, one frame ahead of the second, and elsewhere
    generated = [opening([8, 12, 25])]  # one frame behind the first, misses the second; the third does not count
    figures = closures.phone_closures(generated, original, phones, speech_s=30.0, threshold=0.1, rate_hz=25.0)
    assert figures.intervals == 2
    assert figures.recall == pytest.approx(1 / 2)
    assert figures.false_per_minute == pytest.approx(1 / 0.5)  # frame 12
    assert figures.original_per_minute == pytest.approx(1 / 0.5)  # frame 20


def test_intervals_are_taken_one_frame_longer_at_both_ends():
    """The frames at 0.20, 0.24 and 0.28 s lie inside, so 4 to 8 count."""
    for interval_s in ((0.2, 0.28), (0.165, 0.315)):
        for frame in range(30):
            figures = closures.phone_closures([opening([frame])], [opening([frame])], [[interval_s]], 60.0, 0.1, 25.0)
            assert figures.intervals == (4 <= frame <= 8)
            assert figures.false_per_minute == (not 4 <= frame <= 8 and frame > 0)  # closed from the start is none


def test_phones_beyond_the_clip_and_clips_without_phones():
    curves = [opening([6]), opening([29])]
    figures = closures.phone_closures(curves, curves, [[], [(1.16, 1.4), (2.0, 2.1)]], 60.0, 0.1, 25.0)
    assert (figures.recall, figures.intervals) == (1, 1)
    assert figures.false_per_minute == 1
    nothing = closures.phone_closures(curves, curves, [[], []], 0.0, 0.1, 25.0)
    assert np.isnan([nothing.recall, nothing.false_per_minute, nothing.original_per_minute]).all()


@given(clips=st.lists(st.tuples(FRAMES, FRAMES), min_size=1, max_size=4))
@settings(max_examples=40)
def test_closings_found_clip_by_clip_add_up_to_the_score(clips):
    generated, original = ([opening(list(clip[side]))[:, None] for clip in clips] for side in (0, 1))
    hits, count = closures.clip_closure_counts(generated, original, 0.5)
    for (g, o), hit, wanted in zip(zip(generated, original, strict=True), hits, count, strict=True):
        times = [closures.find_closings(side[:, 0], 0.5).tolist() for side in (g, o)]
        assert wanted.tolist() == [len(times[1])]
        assert hit.tolist() == [sum(any(abs(a - b) <= 2 for a in times[0]) for b in times[1])]
    whole = closures.closure_figures([g[:, 0] for g in generated], [o[:, 0] for o in original], 0.5, 25)
    assert whole.original == sum(count)
    assert whole.score == pytest.approx(np.sum(hits) / np.sum(count) if np.sum(count) else np.nan, nan_ok=True)
