from itertools import product

import numpy as np
import pytest

from lipmotion.stats.trees import (
    Question,
    grow_tree,
    score_gaussian,
    score_multispace,
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


def grown(values, questions=QUESTIONS, contexts=CONTEXTS, sums=None, likelihood=score_gaussian, **options):
    statistics = (sums or statistics_of)(values)
    options = {"parameters": 4, "factor": 1.0, "min_frames": 10.0} | options
    return grow_tree(contexts, statistics, questions, likelihood, **options)


def test_the_likelihood_is_that_of_the_gaussian_fitted_to_the_frames():
    x = np.random.default_rng(0).normal([1, -2], [0.5, 3], (50, 2))
    mean, variance = x.mean(axis=0), x.var(axis=0)
    expected = (-0.5 * (np.log(2 * np.pi * variance) + (x - mean) ** 2 / variance)).sum()
    assert score_gaussian(statistics_of([x]))[0] == pytest.approx(expected, rel=1e-9)


def test_the_question_that_matters_is_asked_first_and_the_tree_can_be_read():
    tree = grown(sample(lambda context: 5.0 if context[0] in "ab" else 0.0))
    assert tree.questions[tree.splits[0]] == Question(0, "early", frozenset("ab"))
    assert len(tree.leaves) == 2
    assert tree.frames[0] == 20 * 64
    leaves = ["  yes: leaf (640 frames)", "  no: leaf (640 frames)"]
    assert tree.text().splitlines() == ["left is early? (1280 frames)", *leaves]
    assert [tree.name(node) for node in range(3)] == ["any", "left is early", "left is not early"]


def test_pure_noise_is_not_split():
    assert len(grown(sample(lambda _: 0.0), factor=1.0).splits) == 1


def test_splits_are_those_of_a_search_by_hand():
    """The root's question has the highest gain of all, counted frame by frame."""
    values = sample(lambda context: 1.0 * (context[1] == "c") + 0.4 * (context[2] in "ab"))
    tree = grown(values)

    def likelihood(chosen):
        x = np.concatenate(chosen)
        return (-0.5 * (np.log(2 * np.pi * x.var(axis=0)) + 1)).sum() * len(x)

    def gain(question):
        answers = np.array([question.answer(context) for context in CONTEXTS])
        return sum(likelihood([values[n] for n in np.flatnonzero(answers == answer)]) for answer in (True, False))

    assert tree.splits[0] == int(np.argmax([gain(question) for question in QUESTIONS]))


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
    assert score_multispace(spaces_of([x]))[0] == pytest.approx(expected)
    assert score_multispace(spaces_of([np.full(4, np.nan)]))[0] == pytest.approx(0)
    assert score_multispace(spaces_of([known])) == pytest.approx(score_gaussian(spaces_of([known])[:, 1:]))
    assert score_multispace(np.zeros((1, 4)))[0] == pytest.approx(0)


def test_voicing_alone_is_worth_a_question():
    draw, values = np.random.default_rng(0), []
    for context in CONTEXTS:
        voiced = draw.random(30) < (0.9 if context[1] in "ab" else 0.1)
        values.append(np.where(voiced, draw.normal(0, 1, 30), np.nan))
    tree = grown(values, sums=spaces_of, likelihood=score_multispace, parameters=3)
    assert tree.questions[tree.splits[0]] == Question(1, "early", frozenset("ab"))


@pytest.mark.parametrize("seed", range(20))
def test_of_questions_that_split_alike_the_first_is_asked_however_sums_are_rounded(seed):
    """Their gains differ by rounding when their answers are in other rows of a matrix product."""
    values = sample(lambda context: 5.0 if context[0] in "ab" else 0.0, seed=seed)
    alike = [Question(0, str(number), frozenset("ab")) for number in range(40)]
    others = [Question(0, f"not {number}", frozenset("cdefgh")) for number in range(40)]
    rounding = np.random.default_rng(seed)

    def likelihood(statistics):
        found = score_gaussian(statistics)
        return found * (1 + 1e-14 * rounding.normal(size=found.shape))

    tree = grown(values, [*alike, *others], likelihood=likelihood)
    assert tree.questions[tree.splits[0]].name == "0"
