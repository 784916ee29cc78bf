import numpy as np
import pytest

from lipmotion_studio.study.analysis.paired import deviations, fit_strengths, link_groups

TEAMS = ("Milwaukee", "Detroit", "Toronto", "New York", "Boston", "Cleveland", "Baltimore")
HOME, AWAY = (
    np.array([row.split() for row in wins.split(";")], float)
    for wins in (
        "0 4 4 4 6 4 6; 3 0 4 4 6 6 4; 2 4 0 2 4 4 6; 3 5 2 0 4 4 6; 5 2 3 4 0 5 6; 2 3 3 4 4 0 2; 2 1 1 2 1 3 0",
        "0 3 2 3 1 2 0; 3 0 2 3 0 1 3; 5 3 0 4 3 2 0; 3 1 5 0 3 2 1; 1 5 3 2 0 2 0; 5 3 4 3 2 0 4; 5 5 6 4 6 4 0",
    )
)
"""Games of the American League, East, 1987; a row for each team at home. Source: Agresti 2002, Table 10.10, p. 438."""


def test_baseball_with_the_advantage_of_the_place_as_published():
    """Source: Agresti 2002, Table 10.11 and p. 438: shares of strength to three decimals, and the advantage at home."""
    model = fit_strengths(HOME, AWAY)
    shares = np.exp(model.strengths) / np.exp(model.strengths).sum()
    assert sorted(np.round(shares, 3)) == [0.044, 0.088, 0.137, 0.157, 0.164, 0.190, 0.220]
    assert TEAMS[int(shares.argmax())] == "Milwaukee"
    assert round(model.order, 3) == 0.302
    assert not model.is_shrunk


def test_errors_are_those_of_a_statistics_package():
    """Source: statsmodels 0.15.0, GLM with family Binomial, on the same games; without Baltimore, and at home."""
    model = fit_strengths(HOME, AWAY)
    contrast = np.eye(7, 8)
    contrast[:6, 6], contrast[6] = -1, np.eye(8)[7]
    found = contrast @ np.append(model.strengths, model.order)
    expected = [1.619555, 1.475357, 1.32711, 1.28134, 1.143803, 0.704694, 0.302261]
    assert found == pytest.approx(np.array(expected), abs=2e-6)
    errors = np.sqrt(np.diag(contrast @ model.covariance @ contrast.T))
    expected = [0.347366, 0.344552, 0.340322, 0.340404, 0.337842, 0.335002, 0.130944]
    assert errors == pytest.approx(np.array(expected), abs=2e-6)


def test_deviations_of_the_answers_sum_to_nothing():
    model = fit_strengths(HOME, AWAY)
    games = [((i, j), True) for i, j in np.ndindex(7, 7) for _ in range(int(HOME[i, j]))]
    games += [((i, j), False) for i, j in np.ndindex(7, 7) for _ in range(int(AWAY[i, j]))]
    pairs, is_first = np.array([pair for pair, _ in games]), np.array([won for _, won in games])
    moved = deviations(model, pairs, is_first)
    assert np.abs(moved).max() > 0.01
    assert moved.sum(axis=0) == pytest.approx(np.zeros(8), abs=1e-8)


def test_what_an_answer_moves_is_what_its_weight_changes():
    model, step = fit_strengths(HOME, AWAY), 1e-4
    more = HOME.copy()
    more[0, 1] += step
    other = fit_strengths(more, AWAY)
    moved = deviations(model, np.array([[0, 1]]), np.array([True]))[0]
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


def test_one_order_alone_has_no_effect():
    model = fit_strengths(np.array([[0, 3, 2], [0, 0, 3], [0, 0, 0.0]]), np.array([[0, 1, 2], [0, 0, 2], [0, 0, 0.0]]))
    assert model.order == 0
    assert not model.is_shrunk


def test_groups_that_nothing_links():
    comparisons = np.zeros((5, 5))
    comparisons[0, 3] = comparisons[4, 3] = comparisons[1, 2] = 1
    assert link_groups(comparisons) == [[0, 3, 4], [1, 2]]
