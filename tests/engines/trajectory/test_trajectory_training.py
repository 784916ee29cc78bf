from dataclasses import replace

import numpy as np
import pytest

from lipmotion.engines.trajectory.engine import TrajectoryConfig
from lipmotion.engines.trajectory.trajectory_training import LEAST_VARIANCE, fit_trajectory
from lipmotion.motion.frame_labels import FullContextState, label_full_context
from lipmotion.testing.examples import examples
from lipmotion.types.progress import silent_monitor

OPTIONS = replace(TrajectoryConfig(states=3, silent_states=7, components=2, acoustic_regression=False).training)
LAYOUT = OPTIONS.layout


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
    apart, together = (fit(corpus, shrinkage=strength, tree_factor=0.2).emission for strength in (1e-9, 1e9))
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
