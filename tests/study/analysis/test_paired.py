import numpy as np
import pytest
from scipy import stats

from lipmotion.errors import InputError
from lipmotion_studio.study.analysis import paired
from lipmotion_studio.study.analysis.paired import compute_deviations, fit_strengths, link_groups
from study.simulated import Effects, comparisons, expected_preference, pair_answer, paired_answers

USUAL = Effects(rater_each=0.4, sentence_each=0.3)


def test_the_binomial_test_is_that_of_a_statistics_package():
    for count in (1, 2, 7, 36, 360):
        for wins in {0, 1, count // 3, count // 2, count - 1, count}:
            expected = stats.binomtest(wins, count)
            assert paired.compute_binomial_p(wins, count) == pytest.approx(expected.pvalue)
            assert paired.compute_exact_interval(wins, count) == pytest.approx(tuple(expected.proportion_ci()))


def test_a_table_is_counted_right():
    answers = [
        pair_answer(("r1", "s1"), ("a", "b"), True),
        pair_answer(("r1", "s1"), ("b", "a"), False),
        pair_answer(("r1", "s2"), ("a", "b"), True),
        pair_answer(("r2", "s1"), ("b", "a"), True),
    ]
    table = paired.tabulate_pairs(answers)
    first, second = table.count_wins()
    assert first.tolist() == [[0, 2], [1, 0]]
    assert second.tolist() == [[0, 0], [1, 0]]
    figures = paired.analyse_pairs(table)
    (pair,) = figures["pairs"]
    assert (pair["condition"], pair["other"], pair["wins"], pair["answers"]) == ("a", "b", 3, 4)
    assert pair["share"] == pytest.approx(2 / 3)  # of three cells: the one in both orders counts once
    assert paired.compare_orders(table).tolist() == [[1, 1], [0, 0]]
    assert figures["consistency"] == {"pairs": 1, "consistent": 1, "share": 1.0}


@pytest.mark.parametrize("other", ["a", ""])
def test_a_pair_has_two_conditions(other):
    with pytest.raises(InputError, match=f"'a' compared with '{other}', required two conditions"):
        paired.tabulate_pairs([pair_answer(("r", "s"), ("a", other), True)])


def test_known_preferences_are_found():
    strengths = np.array([-0.6, -0.2, 0.8])
    small = comparisons(np.random.default_rng(0), strengths, (3, 2), USUAL)
    again = paired.tabulate_pairs(paired_answers(small))
    assert again.conditions == small.conditions
    for name in ("shown", "is_first", "rater", "sentence"):
        assert np.array_equal(getattr(again, name), getattr(small, name)), name
    table = comparisons(np.random.default_rng(1), strengths, (60, 30), USUAL, order=0.3)
    figures = paired.analyse_pairs(table)
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


def test_answers_of_one_rater_are_not_so_many_raters_and_those_who_all_agree_count_once_each():
    """Raters disagree about what is better, each sure of it: the binomial test is wrong, the other is not."""
    cells = np.repeat(np.array([1.0, 1, 1, 0, 1, 0, 1, 1])[:, None], 40, axis=1)
    figures = paired.analyse_shares(cells)
    assert paired.compute_binomial_p(int(cells.sum()), cells.size) < 1e-9
    assert figures["p"] > 0.1
    assert figures["low"] < 0.5 < figures["high"]
    figures = paired.analyse_shares(np.ones((6, 30)))
    assert figures["over"] == paired.ALL_EQUAL
    assert (figures["low"], figures["high"]) == pytest.approx(tuple(stats.binomtest(6, 6).proportion_ci()))
    assert figures["p"] == pytest.approx(2 * 0.5**6)
    assert paired.analyse_shares(np.zeros((6, 30)))["high"] == pytest.approx(1 - figures["low"])


def test_raters_who_prefer_one_side_have_a_share_of_one_half_and_no_interval():
    answers = [
        pair_answer((f"r{r}", f"s{s}"), shown, True)
        for r in range(3)
        for s in range(2)
        for shown in (("a", "b"), ("b", "a"))
    ]
    figures = paired.analyse_pairs(paired.tabulate_pairs(answers))
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
            paired.analyse_pairs(comparisons(draw, strengths, (12, 6), USUAL))["pairs"], truth, strict=True
        )
    ]
    assert 0.93 < np.mean(hits) < 0.97


TEAMS = ("Milwaukee", "Detroit", "Toronto", "New York", "Boston", "Cleveland", "Baltimore")
HOME, AWAY = (
    np.array([row.split() for row in wins.split(";")], float)
    for wins in (
        "0 4 4 4 6 4 6; 3 0 4 4 6 6 4; 2 4 0 2 4 4 6; 3 5 2 0 4 4 6; 5 2 3 4 0 5 6; 2 3 3 4 4 0 2; 2 1 1 2 1 3 0",
        "0 3 2 3 1 2 0; 3 0 2 3 0 1 3; 5 3 0 4 3 2 0; 3 1 5 0 3 2 1; 1 5 3 2 0 2 0; 5 3 4 3 2 0 4; 5 5 6 4 6 4 0",
    )
)
"""Games of the American League, East, 1987; a row for each team at home. Source: Agresti 2002, Table 10.10, p. 438."""


def test_baseball_with_the_advantage_of_the_place_as_published_and_its_deviations_sum_to_nothing():
    """Source: Agresti 2002, Table 10.11 and p. 438: shares of strength to three decimals, and the advantage at home.

    Errors are of statsmodels 0.15.0, GLM with family Binomial, on the same games; without Baltimore, and at home.
    """
    model = fit_strengths(HOME, AWAY)
    shares = np.exp(model.strengths) / np.exp(model.strengths).sum()
    assert sorted(np.round(shares, 3)) == [0.044, 0.088, 0.137, 0.157, 0.164, 0.190, 0.220]
    assert TEAMS[int(shares.argmax())] == "Milwaukee"
    assert round(model.order, 3) == 0.302
    assert not model.is_shrunk
    contrast = np.eye(7, 8)
    contrast[:6, 6], contrast[6] = -1, np.eye(8)[7]
    found = contrast @ np.append(model.strengths, model.order)
    expected = [1.619555, 1.475357, 1.32711, 1.28134, 1.143803, 0.704694, 0.302261]
    assert found == pytest.approx(np.array(expected), abs=2e-6)
    errors = np.sqrt(np.diag(contrast @ model.covariance @ contrast.T))
    expected = [0.347366, 0.344552, 0.340322, 0.340404, 0.337842, 0.335002, 0.130944]
    assert errors == pytest.approx(np.array(expected), abs=2e-6)
    games = [((i, j), True) for i, j in np.ndindex(7, 7) for _ in range(int(HOME[i, j]))]
    games += [((i, j), False) for i, j in np.ndindex(7, 7) for _ in range(int(AWAY[i, j]))]
    pairs, is_first = np.array([pair for pair, _ in games]), np.array([won for _, won in games])
    moved = compute_deviations(model, pairs, is_first)
    assert np.abs(moved).max() > 0.01
    assert moved.sum(axis=0) == pytest.approx(np.zeros(8), abs=1e-8)


def test_what_an_answer_moves_is_what_its_weight_changes():
    model, step = fit_strengths(HOME, AWAY), 1e-4
    more = HOME.copy()
    more[0, 1] += step
    other = fit_strengths(more, AWAY)
    moved = compute_deviations(model, np.array([[0, 1]]), np.array([True]))[0]
    change = np.append(other.strengths - model.strengths, other.order - model.order) / step
    assert moved == pytest.approx(change, rel=1e-2, abs=1e-4)


@pytest.mark.parametrize(
    ("first", "second", "is_shrunk"),
    [
        ([[0, 2], [1, 0]], [[0, 1], [2, 0]], False),
        ([[0, 3], [0, 0]], [[0, 0], [3, 0]], True),  # one always wins
        ([[0, 3], [3, 0]], [[0, 0], [0, 0]], True),  # what is shown first always wins
        ([[0, 3], [2, 0]], [[0, 0], [1, 0]], True),  # the stronger one wins, unless it is second
    ],
)
def test_infinite_strengths_are_shrunk(first, second, is_shrunk):
    model = fit_strengths(np.array(first, float), np.array(second, float))
    assert model.is_shrunk == is_shrunk
    assert np.isfinite(model.strengths).all()
    assert model.strengths.sum() == pytest.approx(0, abs=1e-9)


def test_one_order_alone_has_no_effect_and_groups_are_linked_by_comparisons():
    model = fit_strengths(np.array([[0, 3, 2], [0, 0, 3], [0, 0, 0.0]]), np.array([[0, 1, 2], [0, 0, 2], [0, 0, 0.0]]))
    assert model.order == 0
    assert not model.is_shrunk
    comparisons = np.zeros((5, 5))
    comparisons[0, 3] = comparisons[4, 3] = comparisons[1, 2] = 1
    assert link_groups(comparisons) == [[0, 3, 4], [1, 2]]
