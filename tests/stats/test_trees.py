from itertools import product

import numpy as np
import pytest

from lipmotion.stats.trees import (
    Question,
    gaussian_log_likelihood,
    grow_tree,
    multispace_log_likelihood,
    trees_from_arrays,
    trees_to_arrays,
)

UNITS = ("a", "b", "c", "d")
QUESTIONS = [Question(position, unit, frozenset([unit])) for position in range(3) for unit in UNITS]
QUESTIONS += [Question(position, "early", frozenset("ab")) for position in range(3)]
CONTEXTS = list(product(UNITS, repeat=3))


def statistics_of(values):
    """Return count, sum and sum of squares of each context's values [each shape=(N, D)]."""
    return np.array([np.concatenate([[len(x)], x.sum(axis=0), (x * x).sum(axis=0)]) for x in values])


def sample(mean_of, frames=20, seed=0):
    draw = np.random.default_rng(seed)
    return [draw.normal(mean_of(context), 0.1, (frames, 2)) for context in CONTEXTS]


def grown(values, factor=1.0, least=10.0, contexts=CONTEXTS):
    return grow_tree(
        contexts, statistics_of(values), QUESTIONS, gaussian_log_likelihood, parameters=4, factor=factor, least=least
    )


def test_the_likelihood_is_that_of_the_gaussian_fitted_to_the_frames():
    x = np.random.default_rng(0).normal([1, -2], [0.5, 3], (50, 2))
    mean, variance = x.mean(axis=0), x.var(axis=0)
    expected = (-0.5 * (np.log(2 * np.pi * variance) + (x - mean) ** 2 / variance)).sum()
    assert gaussian_log_likelihood(statistics_of([x]))[0] == pytest.approx(expected, rel=1e-9)


def test_the_question_that_matters_is_asked_first():
    tree = grown(sample(lambda context: 5.0 if context[0] in "ab" else 0.0))
    assert tree.questions[tree.asked[0]] == Question(0, "early", frozenset("ab"))
    assert len(tree.leaves) == 2
    assert tree.frames[0] == 20 * 64


def test_pure_noise_is_not_split():
    assert len(grown(sample(lambda _: 0.0), factor=1.0).asked) == 1


def test_no_leaf_has_fewer_frames_than_asked_for():
    values = sample(lambda context: float(UNITS.index(context[0]) * 4 + UNITS.index(context[1])))
    tree = grown(values, least=100.0)
    assert len(tree.leaves) > 1
    assert tree.frames[tree.leaves].min() >= 100


def test_splits_are_those_of_a_search_by_hand():
    """The root's question has the highest gain of all, counted frame by frame."""
    values = sample(lambda context: 1.0 * (context[1] == "c") + 0.4 * (context[2] in "ab"))
    tree = grown(values)

    def likelihood(chosen):
        x = np.concatenate(chosen)
        return (-0.5 * (np.log(2 * np.pi * x.var(axis=0)) + 1)).sum() * len(x)

    gains = []
    for question in QUESTIONS:
        yes = [x for x, c in zip(values, CONTEXTS, strict=True) if question.answer(c)]
        no = [x for x, c in zip(values, CONTEXTS, strict=True) if not question.answer(c)]
        gains.append(likelihood(yes) + likelihood(no))
    assert tree.asked[0] == int(np.argmax(gains))


def test_a_context_never_seen_is_treated_like_those_that_answer_alike():
    seen = [context for context in CONTEXTS if context[0] != "b"]
    values = [x for x, c in zip(sample(lambda c: 5.0 * (c[0] in "ab")), CONTEXTS, strict=True) if c[0] != "b"]
    questions = [q for q in QUESTIONS if q.name == "early"]  # the only ones about b
    tree = grow_tree(
        seen, statistics_of(values), questions, gaussian_log_likelihood, parameters=4, factor=1.0, least=10.0
    )
    assert tree.path(("b", "a", "a"))[-1] == tree.path(("a", "a", "a"))[-1]
    assert tree.path(("b", "a", "a"))[-1] != tree.path(("c", "a", "a"))[-1]


def test_the_tree_can_be_read():
    tree = grown(sample(lambda context: 5.0 if context[0] in "ab" else 0.0))
    assert tree.text().splitlines() == [
        "left is early? (1280 frames)",
        "  yes: leaf (640 frames)",
        "  no: leaf (640 frames)",
    ]
    assert [tree.name(node) for node in range(3)] == ["any", "left is early", "left is not early"]


def test_trees_come_back_from_arrays():
    trees = {
        "one": grown(sample(lambda context: float(UNITS.index(context[0]) + 3 * UNITS.index(context[2])))),
        "two": grown(sample(lambda _: 0.0)),
    }
    again = trees_from_arrays(trees_to_arrays(trees))
    assert list(again) == ["one", "two"]
    for name, tree in trees.items():
        assert again[name].text() == tree.text()
        assert [again[name].path(c) for c in CONTEXTS] == [tree.path(c) for c in CONTEXTS]


def test_damaged_trees_are_refused():
    for key, change in (
        ("no", lambda no: np.where(no >= 0, 0, no)),  # a loop
        ("no", lambda no: no * 0 - 1),
        ("asked", lambda asked: asked + 100),
        ("asked", lambda asked: asked[:-1]),
    ):
        arrays = trees_to_arrays({"one": grown(sample(lambda context: float(UNITS.index(context[0]))))})
        with pytest.raises(ValueError, match=r"tree|required"):
            trees_from_arrays(arrays | {key: change(arrays[key])})


def spaces_of(values):
    """Return the number of values, of those that are not NaN, and their sums and sums of squares."""
    found = []
    for x in values:
        known = x[~np.isnan(x)]
        found.append([len(x), len(known), known.sum(), (known * known).sum()])
    return np.array(found, float)


def test_frames_without_a_value_are_as_likely_as_they_are_frequent():
    x = np.array([1.0, 2.0, 4.0, np.nan, np.nan])
    known = x[:3]
    gaussian = -0.5 * (np.log(2 * np.pi * known.var()) + (known - known.mean()) ** 2 / known.var())
    expected = 3 * np.log(0.6) + 2 * np.log(0.4) + gaussian.sum()
    assert multispace_log_likelihood(spaces_of([x]))[0] == pytest.approx(expected)
    assert multispace_log_likelihood(spaces_of([np.full(4, np.nan)]))[0] == pytest.approx(0)
    assert multispace_log_likelihood(spaces_of([known])) == pytest.approx(
        gaussian_log_likelihood(spaces_of([known])[:, 1:])
    )
    assert multispace_log_likelihood(np.zeros((1, 4)))[0] == pytest.approx(0)


def test_voicing_alone_is_worth_a_question():
    draw = np.random.default_rng(0)
    values = [
        np.where(draw.random(30) < (0.9 if context[1] in "ab" else 0.1), draw.normal(0, 1, 30), np.nan)
        for context in CONTEXTS
    ]
    tree = grow_tree(
        CONTEXTS, spaces_of(values), QUESTIONS, multispace_log_likelihood, parameters=3, factor=1.0, least=10.0
    )
    assert tree.questions[tree.asked[0]] == Question(1, "early", frozenset("ab"))


def test_frames_that_are_all_alike_gain_no_more_than_the_least_variance_allows():
    x = np.full((5, 1), 3.0)
    assert gaussian_log_likelihood(statistics_of([x]), 0.5)[0] == pytest.approx(-2.5 * np.log(2 * np.pi * 0.5))
    spread = np.array([[0.0], [2.0]])  # a variance of 1 under a Gaussian of 4
    assert gaussian_log_likelihood(statistics_of([spread]), 4.0)[0] == pytest.approx(-(np.log(2 * np.pi * 4) + 0.25))


@pytest.mark.parametrize("seed", range(20))
def test_of_questions_that_split_alike_the_first_is_asked_however_sums_are_rounded(seed):
    """Their gains differ by rounding when their answers are in other rows of a matrix product."""
    values = sample(lambda context: 5.0 if context[0] in "ab" else 0.0, seed=seed)
    alike = [Question(0, str(number), frozenset("ab")) for number in range(40)]
    others = [Question(0, f"not {number}", frozenset("cdefgh")) for number in range(40)]
    rounding = np.random.default_rng(seed)

    def likelihood(statistics):
        found = gaussian_log_likelihood(statistics)
        return found * (1 + 1e-14 * rounding.normal(size=found.shape))

    tree = grow_tree(
        CONTEXTS, statistics_of(values), [*alike, *others], likelihood, parameters=4, factor=1.0, least=10.0
    )
    assert tree.questions[tree.asked[0]].name == "0"
