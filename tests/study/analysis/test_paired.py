import numpy as np
import pytest
from scipy import stats

from lipmotion.errors import InputError
from lipmotion_studio.study.analysis import paired
from study.analysis.simulated import Effects, comparisons, expected_preference, pair_answer, paired_answers

USUAL = Effects(rater_each=0.4, sentence_each=0.3)


def test_the_binomial_test_is_that_of_a_statistics_package():
    for count in (1, 2, 7, 36, 360):
        for wins in {0, 1, count // 3, count // 2, count - 1, count}:
            expected = stats.binomtest(wins, count)
            assert paired.binomial_p(wins, count) == pytest.approx(expected.pvalue)
            assert paired.exact_interval(wins, count) == pytest.approx(tuple(expected.proportion_ci()))


def test_a_table_is_counted_right():
    answers = [
        pair_answer(("r1", "s1"), ("a", "b"), True),
        pair_answer(("r1", "s1"), ("b", "a"), False),
        pair_answer(("r1", "s2"), ("a", "b"), True),
        pair_answer(("r2", "s1"), ("b", "a"), True),
    ]
    table = paired.pair_table(answers)
    first, second = table.wins()
    assert first.tolist() == [[0, 2], [1, 0]]
    assert second.tolist() == [[0, 0], [1, 0]]
    (pair,) = paired.paired_figures(table)["pairs"]
    assert (pair["condition"], pair["other"], pair["wins"], pair["answers"]) == ("a", "b", 3, 4)
    assert pair["share"] == pytest.approx(2 / 3)  # of three cells: the one in both orders counts once
    assert paired.order_agreement(table).tolist() == [[1, 1], [0, 0]]
    assert paired.consistency(table) == {"pairs": 1, "consistent": 1, "share": 1.0}


def test_answers_survive_the_table():
    table = comparisons(np.random.default_rng(0), np.array([0, 0.5, 1]), (3, 2), USUAL)
    again = paired.pair_table(paired_answers(table))
    assert again.conditions == table.conditions
    for name in ("shown", "is_first", "rater", "sentence"):
        assert np.array_equal(getattr(again, name), getattr(table, name)), name


@pytest.mark.parametrize("other", ["a", ""])
def test_a_pair_has_two_conditions(other):
    with pytest.raises(InputError, match=f"'a' compared with '{other}', required two conditions"):
        paired.pair_table([pair_answer(("r", "s"), ("a", other), True)])


def test_known_preferences_are_found():
    strengths = np.array([-0.6, -0.2, 0.8])
    table = comparisons(np.random.default_rng(1), strengths, (60, 30), USUAL, order=0.3)
    figures = paired.paired_figures(table)
    found = {row["condition"]: row for row in figures["bradley_terry"]["conditions"]}
    assert [row["condition"] for row in figures["bradley_terry"]["conditions"]] == ["c2", "c1", "c0"]
    for name, truth in zip(("c0", "c1", "c2"), 0.91 * strengths, strict=True):  # raters and sentences blur odds
        assert found[name]["strength"] == pytest.approx(truth, abs=0.15)
        assert found[name]["low"] < found[name]["strength"] < found[name]["high"]
    assert figures["bradley_terry"]["order"]["strength"] == pytest.approx(0.28, abs=0.08)
    assert figures["first_preferred"]["low"] > 0.5
    row = figures["pairs"][1]
    truth = expected_preference(np.array([-1.4 + 0.3, -1.4 - 0.3]), USUAL).mean()
    assert row["low"] < truth < row["high"]
    assert row["p"] <= row["p_holm"] < 0.001


def test_answers_of_one_rater_are_not_so_many_raters():
    """Raters disagree about what is better, each sure of it: the binomial test is wrong, the other is not."""
    cells = np.repeat(np.array([1.0, 1, 1, 0, 1, 0, 1, 1])[:, None], 40, axis=1)
    figures = paired.share_figures(cells)
    assert paired.binomial_p(int(cells.sum()), cells.size) < 1e-9
    assert figures["p"] > 0.1
    assert figures["low"] < 0.5 < figures["high"]


def test_raters_who_all_agree_count_once_each():
    figures = paired.share_figures(np.ones((6, 30)))
    assert figures["over"] == paired.ALL_EQUAL
    assert (figures["low"], figures["high"]) == pytest.approx(tuple(stats.binomtest(6, 6).proportion_ci()))
    assert figures["p"] == pytest.approx(2 * 0.5**6)
    assert paired.share_figures(np.zeros((6, 30)))["high"] == pytest.approx(1 - figures["low"])


def test_raters_who_prefer_one_side_have_a_share_of_one_half_and_no_interval():
    answers = [
        pair_answer((f"r{r}", f"s{s}"), shown, True)
        for r in range(3)
        for s in range(2)
        for shown in (("a", "b"), ("b", "a"))
    ]
    figures = paired.paired_figures(paired.pair_table(answers))
    (pair,) = figures["pairs"]
    assert pair["share"] == 0.5
    assert np.isnan([pair["low"], pair["high"], pair["p"], pair["p_holm"]]).all()
    assert figures["consistency"]["share"] == 0
    assert figures["bradley_terry"]["is_shrunk"]
    assert np.isnan(figures["bradley_terry"]["order"]["low"])


@pytest.mark.long
def test_intervals_cover_known_preferences():
    draw, strengths = np.random.default_rng(8), np.array([-0.4, 0.0, 0.6])
    truth = expected_preference(np.array([-0.4, -1.0, -0.6]), USUAL)
    hits = [
        row["low"] <= share <= row["high"]
        for _ in range(700)
        for row, share in zip(
            paired.paired_figures(comparisons(draw, strengths, (12, 6), USUAL))["pairs"], truth, strict=True
        )
    ]
    assert 0.93 < np.mean(hits) < 0.97
