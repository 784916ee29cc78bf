import numpy as np
import pytest
from scipy import stats

from lipmotion_studio.study.analysis import crossed
from lipmotion_studio.study.analysis.analyse import compute_power, count_raters, plan_study
from study.simulated import Effects, expected_rating, rated_answers, rating, ratings

MEANS = np.array([3.1, 3.9, 4.7])
XIE_LIU = {"ph-HMM": 3.16, "ph-MSHMM": 3.18, "ph-FHMM": 3.31, "ph-vi-FHMM": 3.39, "ph-CHMM": 3.67}
XIE_LIU |= {"ph-vi-CHMM": 3.87, "recording": 4.71}
"""Overall scores of Xie & Liu 2007, Table 4."""
IMPROVEMENT = {"ph-MSHMM": 0.63, "ph-FHMM": 4.75, "ph-vi-FHMM": 7.28, "ph-CHMM": 16.14, "ph-vi-CHMM": 22.47}
IMPROVEMENT |= {"recording": 49.05}
"""What the same table prints as %RI."""


def simulated(size: tuple[int, int], seed: int = 1, means: np.ndarray = MEANS) -> crossed.RatingTable:
    return ratings(np.random.default_rng(seed), means, size, Effects())


def test_improvement_is_that_of_the_paper():
    values = np.tile(np.array(list(XIE_LIU.values()))[:, None, None], (1, 4, 3))
    table = crossed.RatingTable(tuple(XIE_LIU), values, np.ones(values.shape, np.intp))
    for name, percent in IMPROVEMENT.items():
        assert round(crossed.measure_improvement(table, name, "ph-HMM")["percent"], 2) == percent


def test_improvement_has_an_interval_around_it():
    table = simulated((30, 12))
    row = crossed.measure_improvement(table, "c2", "c0")
    c0, c2 = (table.select_condition(name).mean() for name in ("c0", "c2"))
    assert row["percent"] == pytest.approx(100 * (c2 - c0) / c0)
    assert row["low"] < row["percent"] < row["high"]
    expected = [expected_rating(mean, Effects()) for mean in MEANS]
    assert row["low"] < 100 * (expected[2] / expected[0] - 1) < row["high"]


def test_answers_survive_the_table():
    again = crossed.tabulate_ratings(rated_answers(simulated((3, 4))))
    assert again.conditions == simulated((3, 4)).conditions
    assert np.array_equal(again.values, simulated((3, 4)).values)


def test_known_means_are_found():
    figures = crossed.analyse_ratings(simulated((60, 40)), None)
    assert figures["baseline"] == "c0"
    assert [row["condition"] for row in figures["conditions"]] == ["c2", "c1", "c0"]
    for row, mean in zip(figures["conditions"], MEANS[::-1], strict=True):
        assert row["low"] < expected_rating(mean, Effects()) < row["high"]
        assert (row["answers"], row["raters"], row["sentences"]) == (2400, 60, 40)


def test_a_difference_of_few_raters_on_one_sentence_is_the_paired_t_test():
    table = simulated((12, 1))
    usual = stats.ttest_rel(table.select_condition("c1")[:, 0], table.select_condition("c0")[:, 0])
    row = next(row for row in crossed.analyse_ratings(table, None)["pairs"] if row["other"] == "c1")
    assert row["p"] == pytest.approx(usual.pvalue)
    assert (-row["high"], -row["low"]) == pytest.approx(tuple(usual.confidence_interval()))
    assert row["over"] == "raters"


def test_what_raters_add_to_all_conditions_leaves_differences():
    """Nothing is normalised: a rater who is strict throughout changes no difference."""
    table = simulated((10, 6), means=np.array([2.5, 3.0]))
    strict = table.values + np.linspace(-1, 1, 10)[:, None]
    moved = crossed.RatingTable(table.conditions, strict, table.count)
    assert moved.compare("c1", "c0").interval == pytest.approx(table.compare("c1", "c0").interval)


def test_the_anchor_is_shown_but_not_tested():
    table = simulated((8, 6))
    figures = crossed.analyse_ratings(
        crossed.RatingTable(("a", "anchor", "recording"), table.values, table.count), None
    )
    assert len(figures["conditions"]) == 3
    assert [(row["condition"], row["other"]) for row in figures["pairs"]] == [("a", "recording")]
    assert figures["baseline"] == "a"
    assert [row["condition"] for row in figures["relative_improvement"]] == ["recording"]


def test_conditions_never_compared_by_one_rater_have_no_difference():
    answers = [rating((f"r{r}", f"s{s}"), "ab"[r % 2], 1 + (r + s) % 5) for r in range(6) for s in range(4)]
    figures = crossed.analyse_ratings(crossed.tabulate_ratings(answers), "a")
    (pair,) = figures["pairs"]
    assert np.isnan([pair["difference"], pair["low"], pair["p"], pair["p_holm"]]).all()
    assert pair["over"] == "nothing"
    assert np.isnan(figures["relative_improvement"][0]["percent"])
    assert not np.isnan(figures["conditions"][0]["low"])


@pytest.mark.long
def test_intervals_cover_known_means_near_the_end_of_the_scale():
    draw, truth = np.random.default_rng(3), [expected_rating(mean, Effects()) for mean in MEANS]
    hits = []
    for _ in range(400):
        rows = crossed.analyse_ratings(ratings(draw, MEANS, (20, 6), Effects()), None)["conditions"]
        hits += [row["low"] <= truth[int(row["condition"][1])] <= row["high"] for row in rows]
    assert 0.93 < np.mean(hits) < 0.97


USUAL = crossed.Components(0.16, 0.04, 1.0)


def detected(components: crossed.Components, difference: float, raters: int, sentences: int, studies: int) -> float:
    draw, found = np.random.default_rng(7), 0
    rater, sentence, rest = np.sqrt(components)
    for _ in range(studies):
        values = difference + rest * draw.normal(size=(raters, sentences))
        values += rater * draw.normal(size=(raters, 1)) + sentence * draw.normal(size=(1, sentences))
        found += crossed.estimate_mean(values, 4.0).p_value < 0.05
    return found / studies


@pytest.mark.parametrize("components", [USUAL, crossed.Components(0, 0, 1.0), crossed.Components(0.0, 0.3, 0.5)])
def test_power_is_that_of_simulated_studies(components):
    assert compute_power(components, 0.5, 12, 6) == pytest.approx(detected(components, 0.5, 12, 6, 800), abs=0.04)


def test_the_number_of_raters_is_the_smallest():
    for difference in (0.3, 0.5, 1.0):
        raters = count_raters(USUAL, difference, 12)
        assert raters is not None
        assert compute_power(USUAL, difference, raters, 12) >= 0.8
        assert raters == 2 or compute_power(USUAL, difference, raters - 1, 12) < 0.8
    assert count_raters(USUAL, 0.5, 12, 0.95) > count_raters(USUAL, 0.5, 12)  # type: ignore[operator]


def test_sentences_that_differ_bound_what_raters_can_tell():
    components = crossed.Components(0.1, 0.3, 0.5)
    assert count_raters(components, 0.3, 6) is None
    assert count_raters(components, 0.3, 60) is not None


def test_judgements_that_never_vary():
    nothing = crossed.Components(0, 0, 0)
    assert compute_power(nothing, 0.1, 2, 2) == 1
    assert compute_power(nothing, 0.0, 2, 2) == pytest.approx(0.05)
    assert count_raters(nothing, 0.1, 2) == 2


def test_tables_of_raters():
    rows = plan_study(USUAL, "mos", 12, 0.8)
    assert [row["difference"] for row in rows] == [0.1, 0.2, 0.3, 0.5, 1.0]
    shares = plan_study(crossed.Components(0.05, 0.02, 0.6), "paired", 12, 0.8)
    assert [row["share"] for row in shares] == [0.55, 0.6, 0.65, 0.7, 0.75]
    needed = [row["raters"] for row in shares if row["raters"]]
    assert needed == sorted(needed, reverse=True)
    assert plan_study(None, "mos", 12, 0.8) == plan_study(USUAL, "mos", 1, 0.8) == []


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
    found = crossed.estimate_mean(np.array(SCORES), 9.0)
    assert found.mean == pytest.approx(np.mean(SCORES))
    assert found.over == crossed.BOTH
    assert found.components == pytest.approx((0.629217, 2.113677, 1.422465), abs=2e-4)
    assert found.error == pytest.approx(0.743818, abs=1e-5)


def test_the_variance_is_that_of_the_mean_squares():
    table = TABLE + np.arange(5)
    by_rater, by_sentence, rest = mean_squares(table)
    found = crossed.estimate_mean(table, 4.0)
    variance = (by_rater + by_sentence - rest) / 35
    assert found.error**2 == pytest.approx(variance)
    doubt = by_rater**2 / 6 + by_sentence**2 / 4 + rest**2 / 24
    assert found.degrees == pytest.approx((35 * variance) ** 2 / doubt)


def test_an_effect_estimated_as_nothing_leaves_the_degrees_of_freedom():
    table = TABLE - TABLE.mean(axis=0)  # sentences differ less than by chance
    by_rater, _, rest = mean_squares(table)
    found = crossed.estimate_mean(table, 4.0)
    assert found.components is not None
    assert found.components.sentence == 0
    assert found.error**2 == pytest.approx(by_rater / 35)
    assert found.degrees == pytest.approx(6)
    even = crossed.estimate_mean(table - table.mean(axis=1, keepdims=True), 4.0)
    assert even.degrees == pytest.approx(24)
    assert even.error**2 == pytest.approx(rest / 35)


@pytest.mark.parametrize("by_rater", [True, False])
def test_one_sentence_or_one_rater_is_the_usual_t_interval(by_rater):
    values = TABLE[:, 0]
    found = crossed.estimate_mean(values[:, None] if by_rater else values[None], 4.0)
    usual = stats.ttest_1samp(values, 0)
    assert found.over == (crossed.RATERS if by_rater else crossed.SENTENCES)
    assert found.interval == pytest.approx(tuple(usual.confidence_interval()))
    assert found.p_value == pytest.approx(usual.pvalue)
    assert found.components is None


def test_who_shares_no_sentence_is_grouped_by_what_is_shared():
    table = np.full((6, 3), np.nan)
    table[np.arange(6), np.arange(6) % 3] = TABLE[:6, 0]  # every rater judges one sentence
    found = crossed.estimate_mean(table, 4.0)
    groups = np.array([TABLE[:6, 0][place::3].mean() for place in range(3)])
    assert found.over == crossed.SENTENCES
    assert found.interval == pytest.approx(tuple(stats.ttest_1samp(groups, 0).confidence_interval()))
    assert crossed.estimate_mean(table.T, 4.0).over == crossed.RATERS
    assert crossed.estimate_mean(table.T, 4.0).error == pytest.approx(found.error)


def test_gaps_leave_rows_and_columns_out():
    wider = np.full((9, 8), np.nan)
    wider[1:8, 2:7] = TABLE
    assert crossed.estimate_mean(wider, 4.0) == crossed.estimate_mean(TABLE, 4.0)


def test_components_are_right_in_tables_with_gaps():
    draw, found = np.random.default_rng(2), []
    for _ in range(300):
        table = draw.normal(size=(20, 1)) + 0.5 * draw.normal(size=(1, 12)) + 0.8 * draw.normal(size=(20, 12))
        table[draw.random(table.shape) < 0.4] = np.nan
        found.append(crossed.estimate_mean(table, 4.0).components)
    assert np.mean(found, axis=0) == pytest.approx([1, 0.25, 0.64], rel=0.1)  # type: ignore[arg-type]


@pytest.mark.parametrize("level", [3.0, 0.1 + 0.2, 4 / 3])
def test_equal_judgements_have_no_interval(level):
    """What rounding leaves of their differences is not divided by."""
    table = np.full((4, 3), level)
    table[0] += np.spacing(level)
    found = crossed.estimate_mean(table, 4.0)
    assert found.error == 0
    assert np.isnan(found.interval).all()
    assert np.isnan(found.p_value)


def test_intervals_within_a_scale_stay_there():
    table = np.array([[5, 5, 5], [5, 5, 4], [5, 4, 5], [5, 5, 5.0]])
    found = crossed.estimate_mean(table, 4.0)
    low, high = found.compute_interval_within(1, 5)
    assert found.interval.high > 5 > high > found.mean > low
    assert np.isnan(crossed.estimate_mean(np.full((2, 2), 5.0), 4.0).compute_interval_within(1, 5)).all()


def test_the_correction_of_holm():
    assert crossed.correct_p_values([0.01, 0.04, 0.03, float("nan")]) == pytest.approx(
        [0.03, 0.06, 0.06, np.nan], nan_ok=True
    )
    assert crossed.correct_p_values([0.5, 0.9]) == [1.0, 1.0]
    assert crossed.correct_p_values([]) == []
