import numpy as np
import pytest

from engines.synthetic import examples
from lipmotion.engines.trajectory import train
from lipmotion.engines.trajectory.contexts import SPREAD_LEVELS, level_names, places, rest_place
from lipmotion.types.progress import silent_monitor

OPTIONS = {"parts": 3, "edge_s": 0.08, "components": 2, "shrinkage": 10.0, "variance_shrinkage": 20.0}


def design(corpus, parts: int = 3):
    """Names of all frames that have dynamics, and the static, Δ and Δ² of the opening there."""
    names, rows = [], []
    for example in corpus:
        opening = example.motion["opening"]
        where = places(example.speech.units, len(opening), parts, 0.08)
        names += [level_names(place) for place in where[1:-1]]
        slope, bend = (opening[2:] - opening[:-2]) / 2, opening[2:] - 2 * opening[1:-1] + opening[:-2]
        rows.append(np.stack([opening[1:-1], slope, bend], axis=1))
    return names, np.concatenate(rows)


def test_means_are_a_ridge_regression_on_all_contexts(monkeypatch):
    monkeypatch.setattr(train, "PASSES", 300)
    monkeypatch.setattr(train, "_still", lambda *_: None)
    corpus = examples(3)
    names, motion = design(corpus)
    model = train.fit_trajectory(corpus, **OPTIONS, monitor=silent_monitor)
    columns = list(dict.fromkeys(name for row in names for name in row))
    index = {name: column for column, name in enumerate(columns)}
    X = np.zeros((len(names), len(columns)))
    for row, levels in enumerate(names):
        X[row, [index[name] for name in levels]] = 1
    weights = np.linalg.solve(X.T @ X + OPTIONS["shrinkage"] * np.eye(len(columns)), X.T @ motion)
    for level in model.levels:
        for name, row in level.rows.items():
            assert level.means[row][:, 0] == pytest.approx(weights[index[name]], abs=2e-4)
            assert level.frames[row] == X[:, index[name]].sum()


def test_variances_shrink_towards_the_more_general_ones():
    corpus = examples(4)
    model = train.fit_trajectory(corpus, **OPTIONS, monitor=silent_monitor)
    assert {name.split(":")[0] for name in model.spread} >= {"*", "[bi]", "p", "aa"}
    tight = train.fit_trajectory(corpus, **{**OPTIONS, "variance_shrinkage": 1e9}, monitor=silent_monitor)
    for names in {tuple(level_names(p)[n] for n in SPREAD_LEVELS) for p in places(corpus[0].speech.units, 99, 3, 0.08)}:
        rows = [tight.variances[tight.spread[name]] for name in names]
        assert rows[1] == pytest.approx(rows[0], rel=1e-3)
        assert rows[2] == pytest.approx(rows[0], rel=1e-3)


def test_what_the_mouth_does_in_silence_away_from_speech_is_not_learned():
    calm, restless = examples(4), examples(4)
    for example in restless:
        example.motion.values[5:25:2, 0] += 0.1
    models = [train.fit_trajectory(corpus, **OPTIONS, monitor=silent_monitor) for corpus in (calm, restless)]
    one, two = (model.statistics(rest_place(3)) for model in models)
    assert two[0][:, 0] == pytest.approx(one[0][:, 0], abs=2e-3)
    assert two[1][:, 0] == pytest.approx(one[1][:, 0], rel=0.05)


def test_a_channel_that_never_moves_keeps_a_variance():
    corpus = examples(4)
    for example in corpus:
        example.motion.values[:, 1] = 0.0
    model = train.fit_trajectory(corpus, **OPTIONS, monitor=silent_monitor)
    assert (model.variances > 0).all()
    mean, precision, _ = model.statistics(places(corpus[0].speech.units, 99, 3, 0.08)[70])
    assert np.isfinite(mean).all()
    assert np.isfinite(precision).all()


def test_the_source_of_a_place_is_the_most_particular_context_that_was_seen():
    corpus = examples(6)
    model = train.fit_trajectory(corpus, **OPTIONS, monitor=silent_monitor)
    place = places(corpus[0].speech.units, 99, 3, 0.08)[64]
    name = level_names(place)[-1]
    frames = model.levels[-1].frames[model.levels[-1].rows[name]]
    assert model.statistics(place)[2] == f"{name} ({frames} frames)"
    assert model.statistics(place._replace(left="zh", right="zh"))[2].startswith(f"{place.phone}:")
    assert model.statistics(place._replace(left="zh", phone="oy", right="zh"))[2].startswith("[lr1]:")
