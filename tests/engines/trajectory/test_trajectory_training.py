from dataclasses import replace

import numpy as np
import pytest

from lipmotion.engines.trajectory.config import TrajectoryConfig
from lipmotion.engines.trajectory.trajectory_training import LEAST_VARIANCE, fit_trajectory
from lipmotion.motion.context_window import OFFSETS, SCALE, fit_acoustic_context
from lipmotion.motion.frame_labels import FullContextState, label_full_context
from lipmotion.stats.trees import Question, Tree, fit_regression_node, fit_tree_regressions, ridge, zero_statistics
from lipmotion.testing.examples import examples
from lipmotion.types import silent_monitor

OPTIONS = TrajectoryConfig(states=3, silent_states=7, components=2, acoustic_regression=False)
LAYOUT = OPTIONS.training_layout


def fit(corpus, **changes):
    return fit_trajectory(corpus, replace(OPTIONS, **changes), silent_monitor)


def frames_by_density(corpus, emission):
    """Static, Δ and Δ² of the opening in all frames that have them, by the density of their state."""
    found: dict[int, list[list[float]]] = {}
    for example in corpus:
        x = example.motion["opening"]
        for t, state in list(enumerate(label_full_context(example.speech.units, len(x), LAYOUT)))[1:-1]:
            row = [x[t], (x[t + 1] - x[t - 1]) / 2, x[t + 1] - 2 * x[t] + x[t - 1]]
            found.setdefault(emission.row(state, LAYOUT), []).append(row)
    return {density: np.array(rows) for density, rows in found.items()}


def test_without_shrinkage_each_leaf_has_the_mean_and_variance_of_its_frames():
    corpus = examples(6)
    emission = fit(corpus, shrinkage=1e-9, variance_shrinkage=1e-9).emission
    rest = len(emission.means) - 1
    found = frames_by_density(corpus, emission)
    assert len(found) > 20
    for density, rows in found.items():
        if density == rest:
            continue
        assert emission.means[density, :, 0] == pytest.approx(rows.mean(axis=0), abs=1e-5)
        assert emission.variances[density, :, 0] == pytest.approx(rows.var(axis=0), rel=0.02, abs=1e-5)


def test_shrinkage_draws_leaves_together():
    corpus = examples(6)
    apart, together = (fit(corpus, shrinkage=strength, tree_factor=0.2).emission for strength in (1e-9, 1e6))
    found = frames_by_density(corpus, apart)
    overall = np.concatenate([rows for density, rows in found.items() if density < len(apart.means) - 1])[:, 0].mean()
    assert np.ptp(apart.means[:-1, 0, 0]) > 0.2
    assert together.means[:-1, 0, 0] == pytest.approx(np.full(len(together.means) - 1, overall), abs=5e-3)


def test_trees_tell_apart_what_moves_apart():
    emission = fit(examples(12)).emission
    middle = {
        phone: emission.means[emission.row(FullContextState("t", phone, "s", 1), LAYOUT), 0, 0]
        for phone in ("aa", "iy", "uw", "p")
    }
    assert middle["aa"] > middle["iy"] + 0.1
    assert middle["iy"] > middle["p"] + 0.05
    assert {tree.questions[tree.asked[0]].position for tree in emission.forest.values() if tree.asked[0] >= 0} >= {1}


def test_a_channel_that_never_moves_keeps_a_variance():
    corpus = examples(4)
    for example in corpus:
        example.motion.values[:, 1] = 0.0
    emission = fit(corpus, acoustic_regression=True, acoustic_components=20).emission
    assert (emission.variances >= LEAST_VARIANCE / 1e4).all()
    rows = np.array([emission.row(state, LAYOUT) for state in label_full_context(corpus[0].speech.units, 99, LAYOUT)])
    for statistic in emission.statistics(rows, corpus[0].speech.features.values, slice(0, 99)):
        assert np.isfinite(statistic).all()


def test_the_source_of_a_state_names_the_leaf_of_its_density():
    emission = fit(examples(6)).emission
    said = emission.source(FullContextState("t", "aa", "p", 1), LAYOUT)
    assert said.startswith("t-aa+p speech.1: ")
    assert said.endswith(" frames)")
    assert emission.source(LAYOUT.rest, LAYOUT) == "rest"


def test_phones_without_training_frames_resolve_like_those_of_their_class():
    emission = fit(examples(8)).emission
    for phone in ("zh", "oy", "em"):
        assert 0 <= emission.row(FullContextState("zh", phone, "ng", 2), LAYOUT) < len(emission.means) - 1
    assert emission.row(FullContextState("t", "sp", "t", 6), LAYOUT) == emission.row(
        FullContextState("t", "sil", "t", 6), LAYOUT
    )


REGRESSION = TrajectoryConfig(
    states=3, silent_states=7, components=2, acoustic_components=20, ridge=10.0, ridge_frames=50.0
)


def moments_of(z, r):
    moments = zero_statistics(z.shape[1], r.shape[1])
    moments.add(z.astype(np.float32), r.astype(np.float32))
    return moments


def sample(frames, truth, seed):
    draw = np.random.default_rng(seed)
    z = draw.normal(size=(frames, len(truth)))
    return z, z @ truth + draw.normal(0, 0.1, (frames, truth.shape[1]))


def small_tree():
    """A root that splits twice: nodes 0 (1 2), 2 (3 4)."""
    questions = (Question(0, "a", frozenset("a")), Question(0, "b", frozenset("b")))
    return Tree(
        questions, np.array([0, -1, 1, -1, -1], np.int32), np.array([2, -1, 4, -1, -1], np.int32),
        np.array([100.0, 40, 60, 50, 10]),
    )  # fmt: skip


def test_the_owner_is_the_last_node_with_enough_frames():
    tree = small_tree()
    paths = [tree.path_to(leaf) for leaf in (1, 3, 4)]
    assert paths == [[0, 1], [0, 2, 3], [0, 2, 4]]
    assert [fit_regression_node(tree, path, 45) for path in paths] == [0, 3, 2]
    assert [fit_regression_node(tree, path, 1000) for path in paths] == [0, 0, 0]


def test_each_node_is_drawn_towards_the_one_above():
    tree, truth = small_tree(), np.random.default_rng(5).normal(size=(3, 2))
    parts = {node: moments_of(*sample(frames, truth + node, node)) for node, frames in ((0, 40), (2, 10), (3, 50))}
    z, r = sample(30, truth, 1)
    stacked = np.concatenate([z, np.sqrt(5.0) * np.eye(3)]), np.concatenate([r, np.sqrt(5.0) * np.ones((3, 2))])
    least_squares = np.linalg.lstsq(*stacked, rcond=None)[0]
    assert ridge(moments_of(z, r), np.ones((3, 2)), 5.0) == pytest.approx(least_squares, abs=1e-5)
    found = fit_tree_regressions(tree, parts, np.zeros((3, 2)), 7.0)
    root = ridge(parts[0] + parts[2] + parts[3], np.zeros((3, 2)), 7.0)
    below = ridge(parts[2] + parts[3], root, 7.0)
    assert found[0] == pytest.approx(root)
    assert found[2] == pytest.approx(below)
    assert found[3] == pytest.approx(ridge(parts[3], below, 7.0))
    stiff = fit_tree_regressions(tree, parts, np.ones((3, 2)), 1e12)
    assert stiff[3] == pytest.approx(np.ones((3, 2)), abs=1e-6)


def test_the_context_uses_features_around_a_frame_and_no_further():
    draw = np.random.default_rng(0)
    recordings = [draw.normal(size=(80, 3)).astype(np.float32) for _ in range(4)]
    window = fit_acoustic_context(recordings, 10)
    x = recordings[0]
    z = window(x, slice(None))
    assert z.shape == (80, 10)
    assert np.array_equal(window(x, np.array([40, 41])), z[40:42])
    changed = x.copy()
    changed[40] += 1
    moved = np.nonzero(np.abs(window(changed, slice(None)) - z).max(axis=1) > 1e-4)[0]
    assert set(moved) == {40 - offset for offset in OFFSETS}
    everything = np.concatenate([window(one, slice(None)) for one in recordings])
    assert everything.mean(axis=0) == pytest.approx(np.zeros(10), abs=0.05)
    assert np.cov(everything.T) == pytest.approx(np.diag(np.diag(np.cov(everything.T))), abs=0.15)
    lengths = np.square(fit_acoustic_context(recordings, 33)(x, slice(None))).sum(axis=1)
    assert SCALE * 0.5 < np.sqrt(lengths.mean()) < SCALE * 1.5


def loud_and_soft(count):
    """The same sentences said with more or less voice: the first feature says how far the mouth opens."""
    for number, one in enumerate(examples(count)):
        gain = np.random.default_rng(number).uniform(0.5, 1.5)
        values = one.speech.features.values.copy()
        values[:, 0] = 3 * (gain - 1)
        motion = one.motion.values.copy()
        motion[:, 0] *= gain
        speech = replace(one.speech, features=replace(one.speech.features, values=values))
        yield replace(one, speech=speech, motion=replace(one.motion, values=motion))


def error(model, corpus):
    squares = []
    for one in corpus:
        states = label_full_context(one.speech.units, len(one.valid), REGRESSION.training_layout)
        rows = np.array([model.emission.row(state, REGRESSION.training_layout) for state in states])
        means, _ = model.emission.statistics(rows, one.speech.features.values, slice(None))
        squares.append((means[:, 0, 0] - one.motion["opening"])[60:-60] ** 2)
    return float(np.sqrt(np.concatenate(squares).mean()))


def test_means_follow_the_sound():
    corpus = list(loud_and_soft(16))
    plain, regressed = (
        fit_trajectory(corpus[:12], replace(REGRESSION, acoustic_regression=on), silent_monitor) for on in (False, True)
    )
    assert error(regressed, corpus[12:]) < 0.75 * error(plain, corpus[12:])
    assert regressed.emission.variances[:-1, 0, 0].mean() < plain.emission.variances[:-1, 0, 0].mean()


def test_the_rest_pose_has_no_regression():
    model = fit_trajectory(list(loud_and_soft(12)), REGRESSION, silent_monitor)
    assert model.emission.regression.rows[-1] == -1
    rows = np.full(5, len(model.emission.means) - 1)
    means, _ = model.emission.statistics(rows, np.random.default_rng(0).normal(size=(5, 39)), slice(None))
    assert means == pytest.approx(np.repeat(model.emission.means[-1:], 5, axis=0))
