import numpy as np
import pytest

from hmm.multistream.synthetic import observed, random_joint
from lipmotion.hmm.multistream.densities import (
    GaussianStatistics,
    StreamScale,
    TiedDensities,
    fit_scale,
    make_standard_normals,
)
from lipmotion.hmm.multistream.streams import STREAMS, ObservedStream, StreamWeights
from lipmotion.stats.mixture import Mixtures
from oracles import joint as slow


def test_densities_are_those_of_the_formulas():
    for name, components in (*((name, 3) for name in STREAMS), ("f0", 1)):
        hmm = random_joint(1, components=components)
        model, data = hmm.models[name], observed(np.random.default_rng(2), 12)
        leaves = np.array([2, 0, 2, 1])
        found = model.tied.log_density(model.scale.standardise(data.streams[name]), leaves, model.scale.log_determinant)
        stream = data.streams[name]
        expected = [
            [slow.stream_density(model, leaf, stream.values[t], stream.known[t]) for leaf in leaves] for t in range(12)
        ]
        assert found == pytest.approx(np.array(expected), abs=1e-3)


def test_voiced_and_unvoiced_together_are_everything():
    hmm = random_joint(3, components=2)
    model = hmm.models["f0"]
    grid = np.linspace(-40, 40, 20_001)
    leaves = np.arange(model.forest.size)

    def density(values, known):
        rows = model.scale.standardise(ObservedStream(values[:, None], np.full(len(values), known)))
        return np.exp(model.tied.log_density(rows, leaves, model.scale.log_determinant).astype(float))

    voiced = density(grid, True).sum(axis=0) * (grid[1] - grid[0])
    unvoiced = density(np.zeros(1), False)[0]
    assert voiced == pytest.approx(model.tied.voiced, abs=1e-3)
    assert voiced + unvoiced == pytest.approx(np.ones(len(leaves)), abs=1e-3)


def test_a_weight_of_nothing_is_a_stream_that_is_not_there():
    hmm, data = random_joint(4), observed(np.random.default_rng(5), 9)
    leaves = hmm.leaves([(("a", "b", "a"), state) for state in range(3)])
    without = StreamWeights(f0=0, motion=0)
    some = {name: stream for name, stream in data.streams.items() if name not in ("f0", "motion")}
    found = hmm.log_density(hmm.standardise(data, without), leaves, without)
    alone = hmm.log_density(hmm.standardise(type(data)(some), StreamWeights()), leaves, StreamWeights())
    assert np.array_equal(found, alone)
    assert not np.allclose(found, hmm.log_density(hmm.standardise(data, StreamWeights()), leaves, StreamWeights()))


def sums_of(values, share):
    rows = np.concatenate([np.ones((len(values), 2)), values, values**2], axis=1)
    sums = GaussianStatistics.zeros(1, 1, values.shape[1])
    sums.add(np.array([0]), (share[:, None] * rows).sum(axis=0)[None])
    return sums


def test_one_gaussian_takes_the_mean_and_variance_of_its_frames():
    values, share = np.random.default_rng(0).normal(1, 2, (50, 3)), np.random.default_rng(1).random(50)
    better = make_standard_normals(1, 3, False).reestimate(sums_of(values, share), 1e-3).mixtures
    mean = np.average(values, axis=0, weights=share)
    assert better.means[0, 0] == pytest.approx(mean, abs=1e-5)
    assert better.variances[0, 0] == pytest.approx(np.average((values - mean) ** 2, axis=0, weights=share), rel=1e-4)


def test_variances_have_a_floor_and_voicing_is_never_certain():
    after = make_standard_normals(1, 2, True).reestimate(sums_of(np.ones((50, 2)), np.ones(50)), 0.02)
    assert after.mixtures.variances[0, 0] == pytest.approx([0.02, 0.02])
    assert 0 < after.voiced[0] < 1


def test_only_gaussians_with_data_are_split():
    mixtures = Mixtures(np.zeros((2, 1), np.float32), np.zeros((2, 1, 1), np.float32), np.ones((2, 1, 1), np.float32))
    sums = GaussianStatistics(np.array([100.0, 10.0]), np.array([[[100.0, 0, 100]], [[10.0, 0, 10]]]))
    twice = TiedDensities(mixtures, None).split(sums).mixtures
    assert np.exp(twice.log_weights) == pytest.approx(np.array([[0.5, 0.5], [1, 0]]))
    assert np.ptp(twice.means[0]) > 0
    assert twice.means[1, 0, 0] == 0


def test_the_scale_is_that_of_known_frames():
    values = np.array([[1.0, 7.0], [3.0, 7.0], [100.0, 100.0]])
    scale, share = fit_scale([ObservedStream(values, np.array([True, True, False]))])
    assert scale.mean.tolist() == [2, 7]
    assert scale.deviation[0] == 1
    assert 0 < scale.deviation[1] < 1e-3
    assert share == pytest.approx(2 / 3)
    assert np.isfinite(
        StreamScale(scale.mean, scale.deviation).standardise(ObservedStream(values, np.ones(3, bool)))
    ).all()
