from __future__ import annotations

import numpy as np
import pytest

from lipmotion.measures import curves
from lipmotion.measures.closures import closure_figures
from lipmotion_lab.evaluation.evaluate import (
    ClipStatistic,
    closing_score_statistic,
    correlation_statistic,
    distance_statistic,
    significance_mark,
)

Clips = list[np.ndarray]


@pytest.fixture
def clips() -> tuple[Clips, Clips, Clips]:
    """Original curves, curves close to them, and curves less close: six clips of three channels far from 0."""
    draw = np.random.default_rng(3)
    original = [draw.normal(size=(int(n), 3)) + 50 for n in draw.integers(20, 40, 6)]
    near = [0.9 * o + 0.2 * draw.normal(size=o.shape) for o in original]
    far = [0.4 * o + draw.normal(size=o.shape) for o in original]
    return original, near, far


def test_figures_are_those_of_the_measures(clips: tuple[Clips, Clips, Clips]) -> None:
    original, near, _ = clips
    wanted = curves.pooled_correlation(near, original).mean()
    assert correlation_statistic(near, original).value == pytest.approx(wanted, abs=1e-12)
    assert distance_statistic(near, original).value == pytest.approx(curves.mean_distance(near, original), abs=1e-12)
    some, others = [g[:, :1] for g in near], [o[:, :1] for o in original]
    score = closure_figures([g[:, 0] for g in near], [o[:, 0] for o in original], 50, 25).score
    assert closing_score_statistic(some, others, 50).value == pytest.approx(100 * score)


def test_a_channel_that_stands_still_explains_nothing(clips: tuple[Clips, Clips, Clips]) -> None:
    original, near, _ = clips
    still = [np.concatenate([g[:, :2], np.full((len(g), 1), 0.1)], axis=1) for g in near]
    assert correlation_statistic(still, original).value == pytest.approx(
        curves.pooled_correlation(still, original).mean(), abs=1e-12
    )


def test_nothing_closes() -> None:
    open_mouth = [np.ones((5, 1))]
    assert np.isnan(closing_score_statistic(open_mouth, open_mouth, 0.5).value)


def test_the_interval_is_that_of_drawn_clips(clips: tuple[Clips, Clips, Clips]) -> None:
    original, near, far = clips
    draw = np.random.default_rng(7)
    drawn = [draw.integers(6, size=6) for _ in range(50)]

    def acc(made: Clips, chosen: np.ndarray) -> float:
        return float(curves.pooled_correlation([made[i] for i in chosen], [original[i] for i in chosen]).mean())

    one, other = correlation_statistic(near, original), correlation_statistic(far, original)
    wanted = np.percentile([acc(near, chosen) for chosen in drawn], [2.5, 97.5])
    assert one.interval(7) == pytest.approx(tuple(wanted), abs=1e-12)
    paired = np.percentile([acc(near, chosen) - acc(far, chosen) for chosen in drawn], [2.5, 97.5])
    assert one.gain(other, 7) == pytest.approx(tuple(paired), abs=1e-12)
    assert significance_mark(one.gain(other, 7)) == "*"
    assert one.gain(one, 7) == (0, 0)


def test_the_interval_of_one_clip_is_its_value() -> None:
    one = ClipStatistic([np.array([3.0, 2.0])], lambda total: float(total[0] / total[1]))
    assert one.interval(0) == (1.5, 1.5)


@pytest.mark.parametrize(
    ("gain", "wanted"),
    [((0.1, 0.2), "*"), ((-2, -0.1), "*"), ((-0.1, 0.1), ""), ((0, 0), ""), ((2e-10, 7e-9), ""), ((None, None), "")],
)
def test_marks(gain: tuple[float, float], wanted: str) -> None:
    assert significance_mark(gain) == wanted
