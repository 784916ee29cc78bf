import numpy as np
import pytest
from scipy import stats

from lipmotion_studio.study.analysis.crossed import BOTH, RATERS, SENTENCES, crossed_mean, holm

TABLE = np.random.default_rng(4).normal(3, 1, (7, 5)) + np.random.default_rng(5).normal(size=(7, 1))


def mean_squares(table: np.ndarray) -> tuple[float, float, float]:
    """Return the mean squares of a table without gaps, as textbooks have them."""
    (R, S), mean = table.shape, table.mean()
    rest = table - table.mean(axis=1, keepdims=True) - table.mean(axis=0) + mean
    by_rater = S * np.square(table.mean(axis=1) - mean).sum() / (R - 1)
    by_sentence = R * np.square(table.mean(axis=0) - mean).sum() / (S - 1)
    return by_rater, by_sentence, np.square(rest).sum() / ((R - 1) * (S - 1))


SCORES = [
    [1.55, 3.02, 5.86, 5.86, 4.56], [1.67, 2.05, 3.82, 3.07, 5.92], [2.99, 5.33, 5.07, 6.26, 5.26],
    [5.67, 2.50, 6.52, 6.09, 6.54], [3.48, 4.46, 6.52, 7.03, 9.62], [1.28, 4.11, 4.22, 6.89, 4.99],
    [2.10, 3.66, 2.96, 6.43, 6.63],
]  # fmt: skip


def test_components_are_those_of_a_mixed_model():
    """Source: statsmodels 0.15.0, MixedLM by REML, with variance components of rows and columns."""
    found = crossed_mean(np.array(SCORES), 9.0)
    assert found.mean == pytest.approx(np.mean(SCORES))
    assert found.over == BOTH
    assert found.components == pytest.approx((0.629217, 2.113677, 1.422465), abs=2e-4)
    assert found.error == pytest.approx(0.743818, abs=1e-5)


def test_the_variance_is_that_of_the_mean_squares():
    table = TABLE + np.arange(5)
    by_rater, by_sentence, rest = mean_squares(table)
    found = crossed_mean(table, 4.0)
    variance = (by_rater + by_sentence - rest) / 35
    assert found.error**2 == pytest.approx(variance)
    doubt = by_rater**2 / 6 + by_sentence**2 / 4 + rest**2 / 24
    assert found.degrees == pytest.approx((35 * variance) ** 2 / doubt)


def test_an_effect_estimated_as_nothing_leaves_the_degrees_of_freedom():
    table = TABLE - TABLE.mean(axis=0)  # sentences differ less than by chance
    by_rater, _, rest = mean_squares(table)
    found = crossed_mean(table, 4.0)
    assert found.components is not None
    assert found.components.sentence == 0
    assert found.error**2 == pytest.approx(by_rater / 35)
    assert found.degrees == pytest.approx(6)
    even = crossed_mean(table - table.mean(axis=1, keepdims=True), 4.0)
    assert even.degrees == pytest.approx(24)
    assert even.error**2 == pytest.approx(rest / 35)


@pytest.mark.parametrize("by_rater", [True, False])
def test_one_sentence_or_one_rater_is_the_usual_t_interval(by_rater):
    values = TABLE[:, 0]
    found = crossed_mean(values[:, None] if by_rater else values[None], 4.0)
    usual = stats.ttest_1samp(values, 0)
    assert found.over == (RATERS if by_rater else SENTENCES)
    assert found.interval == pytest.approx(tuple(usual.confidence_interval()))
    assert found.p_value == pytest.approx(usual.pvalue)
    assert found.components is None


def test_who_shares_no_sentence_is_grouped_by_what_is_shared():
    table = np.full((6, 3), np.nan)
    table[np.arange(6), np.arange(6) % 3] = TABLE[:6, 0]  # every rater judges one sentence
    found = crossed_mean(table, 4.0)
    groups = np.array([TABLE[:6, 0][place::3].mean() for place in range(3)])
    assert found.over == SENTENCES
    assert found.interval == pytest.approx(tuple(stats.ttest_1samp(groups, 0).confidence_interval()))
    assert crossed_mean(table.T, 4.0).over == RATERS
    assert crossed_mean(table.T, 4.0).error == pytest.approx(found.error)


def test_gaps_leave_rows_and_columns_out():
    wider = np.full((9, 8), np.nan)
    wider[1:8, 2:7] = TABLE
    assert crossed_mean(wider, 4.0) == crossed_mean(TABLE, 4.0)


def test_components_are_right_in_tables_with_gaps():
    draw, found = np.random.default_rng(2), []
    for _ in range(300):
        table = draw.normal(size=(20, 1)) + 0.5 * draw.normal(size=(1, 12)) + 0.8 * draw.normal(size=(20, 12))
        table[draw.random(table.shape) < 0.4] = np.nan
        found.append(crossed_mean(table, 4.0).components)
    assert np.mean(found, axis=0) == pytest.approx([1, 0.25, 0.64], rel=0.1)  # type: ignore[arg-type]


@pytest.mark.parametrize("level", [3.0, 0.1 + 0.2, 4 / 3])
def test_equal_judgements_have_no_interval(level):
    """What rounding leaves of their differences is not divided by."""
    table = np.full((4, 3), level)
    table[0] += np.spacing(level)
    found = crossed_mean(table, 4.0)
    assert found.error == 0
    assert np.isnan(found.interval).all()
    assert np.isnan(found.p_value)


def test_intervals_within_a_scale_stay_there():
    table = np.array([[5, 5, 5], [5, 5, 4], [5, 4, 5], [5, 5, 5.0]])
    found = crossed_mean(table, 4.0)
    low, high = found.interval_within(1, 5)
    assert found.interval.high > 5 > high > found.mean > low
    assert np.isnan(crossed_mean(np.full((2, 2), 5.0), 4.0).interval_within(1, 5)).all()


def test_a_scale_of_any_place_and_size_has_the_same_interval():
    share = crossed_mean((TABLE - TABLE.min() + 1) / 10, 1.0)
    moved = crossed_mean((TABLE - TABLE.min() + 1) / 10 * 100 - 20, 100.0)
    expected = np.array(share.interval_within(0, 1)) * 100 - 20
    assert moved.interval_within(-20, 80) == pytest.approx(tuple(expected))


def test_the_correction_of_holm():
    assert holm([0.01, 0.04, 0.03, float("nan")]) == pytest.approx([0.03, 0.06, 0.06, np.nan], nan_ok=True)
    assert holm([0.5, 0.9]) == [1.0, 1.0]
    assert holm([]) == []


@pytest.mark.long
def test_intervals_cover_the_truth():
    draw, hits = np.random.default_rng(1), 0
    for _ in range(2000):
        table = 0.5 * draw.normal(size=(12, 1)) + 0.3 * draw.normal(size=(1, 6)) + 0.8 * draw.normal(size=(12, 6))
        low, high = crossed_mean(table, 4.0).interval
        hits += low <= 0 <= high
    assert 0.93 < hits / 2000 < 0.97
