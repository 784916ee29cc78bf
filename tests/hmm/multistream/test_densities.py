import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmm.multistream.synthetic import observed, random_joint
from lipmotion.errors import InputError, ModelFormatError
from lipmotion.hmm.multistream import recognise
from lipmotion.hmm.multistream.densities import (
    MOTION,
    STREAMS,
    GaussianStatistics,
    ObservedStream,
    StreamObservations,
    StreamScale,
    StreamWeights,
    TiedDensities,
    fit_scale,
    make_standard_normals,
    stream_observations,
)
from lipmotion.hmm.multistream.model import joint_from_arrays, joint_to_arrays
from lipmotion.stats.curves import with_dynamics
from lipmotion.stats.mixture import Mixtures
from oracles import joint as slow
from oracles.statistics import generate_trajectory


def test_densities_are_those_of_the_formulas():
    for name, components in (*((name, 3) for name in STREAMS), ("f0", 1)):
        model = random_joint(1, components=components).models[name]
        stream, leaves = observed(np.random.default_rng(2), 12).streams[name], np.array([2, 0, 2, 1])
        found = model.tied.log_density(model.scale.standardise(stream), leaves, model.scale.log_determinant)
        for values, known, densities in zip(stream.values, stream.known, found, strict=True):
            expected = [slow.stream_density(model, leaf, values, known) for leaf in leaves]
            assert densities == pytest.approx(np.array(expected), abs=1e-3)


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


NAN = float("nan")


def test_f0_has_a_slope_only_where_all_frames_of_the_window_are_voiced():
    pitch = np.array([NAN, 4.0, 4.2, 4.6, NAN, NAN, 4.0, 4.1])
    streams = stream_observations(np.zeros((8, 3)), pitch).streams
    assert streams["f0"].known.tolist() == [False, True, True, True, False, False, True, True]
    for name in ("f0_slope", "f0_curvature"):
        assert np.flatnonzero(streams[name].known).tolist() == [2]
    assert streams["f0_slope"].values[2, 0] == pytest.approx(0.3)
    assert streams["f0_curvature"].values[2, 0] == pytest.approx(0.2)


def test_motion_is_unknown_beside_frames_that_were_not_measured():
    motion = np.arange(14.0).reshape(7, 2) ** 2
    seen = np.ones(7, bool)
    seen[3], motion[3] = False, NAN
    stream = stream_observations(np.zeros((7, 3)), motion=motion, measured=seen).streams["motion"]
    assert np.flatnonzero(stream.known).tolist() == [1, 5]
    assert stream.values[1].reshape(3, 2)[2] == pytest.approx(motion[0] - 2 * motion[1] + motion[2])
    assert (stream.values[~stream.known] == 0).all()


def test_what_does_not_fit_is_refused():
    for odd in (
        {"log_f0": np.zeros(4)},
        {"motion": np.full((5, 2), NAN)},
        {"motion": np.zeros((5, 2)), "measured": np.ones(4, bool)},
    ):
        with pytest.raises(InputError):
            stream_observations(np.zeros((5, 3)), **odd)
    with pytest.raises(InputError, match="required speech"):
        StreamObservations({"motion": ObservedStream(np.zeros((3, 3)), np.ones(3, bool))})


HMM = random_joint(1, ("a", "b", "c"))


def test_a_model_comes_back_as_it_was():
    arrays = joint_to_arrays(HMM, np.float32)
    again = joint_from_arrays(arrays, HMM.config)
    data = observed(np.random.default_rng(2), 30)
    assert recognise.recognise_units(again, data)[0] == recognise.recognise_units(HMM, data)[0]
    found, wanted = (
        recognise.solve_trajectory(recognise.select_densities(m, recognise.align(m, data, ("sil", "a", "sil"))))
        for m in (again, HMM)
    )
    assert np.array_equal(found[0], wanted[0])
    for key, array in joint_to_arrays(again, np.float32).items():
        assert array.dtype == arrays[key].dtype
        assert np.array_equal(array, arrays[key]), key


def changed(**changes):
    arrays = joint_to_arrays(HMM)
    for key, change in changes.items():
        name = key.replace("__", "/")
        if change is None:
            del arrays[name]
        else:
            arrays[name] = change(arrays[name].copy())
    return arrays


def put(value, where=(0,)):
    def change(array):
        array[where] = value
        return array

    return change


DAMAGED = [
    *({name.replace("/", "__"): None} for name in sorted(joint_to_arrays(HMM))[::3]), {"log_stay": put(np.nan)},
    {"bigram": lambda a: a[:-1]}, {"units": put("b")}, {"free": put("q")}, {"spoken": lambda a: a * 0},
    {"streams": put("motion")}, {"speech__means": put(np.inf)}, {"speech__variances": put(0.0)},
    {"speech__log_weights": put(5.0)}, {"speech__deviation": put(0.0)}, {"speech__asked": put(10_000)},
    {"speech__trees": put("7")}, {"f0__voiced": put(1.0)}, {"motion__sizes": put(0)},
]  # fmt: skip


def test_damaged_arrays_are_refused():
    for changes in DAMAGED:
        with pytest.raises(ModelFormatError, match="damaged"):
            joint_from_arrays(changed(**changes), HMM.config)
    with pytest.raises(ModelFormatError):
        joint_from_arrays(joint_to_arrays(HMM), random_joint(1, states=2).config)


def random_densities(seed, frames, components, dimensions=2):
    draw = np.random.default_rng(seed)
    precisions = draw.uniform(0.2, 9, (frames, components, 3, dimensions))
    precisions[[0, -1], :, 1:] = 0
    return recognise.FrameDensities(
        np.log(draw.dirichlet(np.full(components, 2.0), frames)),
        draw.normal(0, 2, (frames, components, 3, dimensions)),
        precisions,
    )


@settings(max_examples=30)
@given(frames=st.integers(1, 12), seed=st.integers(0, 50))
def test_one_gaussian_has_the_closed_form(frames, seed):
    densities = random_densities(seed, frames, 1)
    values, log_likelihoods = recognise.solve_trajectory(densities)
    for channel in range(2):
        mean, precision = densities.means[:, 0, :, channel], densities.precisions[:, 0, :, channel]
        assert values[:, channel] == pytest.approx(generate_trajectory(mean, precision)[0], abs=1e-8)
    assert len(log_likelihoods) == 1


@settings(max_examples=30)
@given(frames=st.integers(1, 25), components=st.integers(2, 4), seed=st.integers(0, 50))
def test_the_likelihood_of_the_trajectory_never_falls(frames, components, seed):
    densities = random_densities(seed, frames, components)
    values, log_likelihoods = recognise.solve_trajectory(densities, iterations=50)
    assert (np.diff(log_likelihoods) > -1e-9 * frames).all()
    assert log_likelihoods[-1] == pytest.approx(slow_log_likelihood(densities, values), abs=1e-8)


def slow_log_likelihood(densities, values):
    dynamics, total = with_dynamics(values), 0.0
    for t, weights in enumerate(densities.log_weights):
        rows = slice(0, 3 if 0 < t < len(values) - 1 else 1)
        each = []
        for m, weight in enumerate(weights):
            p, off = densities.precisions[t, m, rows], dynamics[t, rows] - densities.means[t, m, rows]
            each.append(weight + 0.5 * (np.log(p / (2 * np.pi)) - p * off * off).sum())
        total += np.logaddexp.reduce(each)
    return total


def test_mixtures_take_sides():
    means = np.zeros((30, 2, 3, 1))
    means[:, 0, 0], means[:, 1, 0] = 1.0, -1.0
    densities = recognise.FrameDensities(np.log(np.tile([0.6, 0.4], (30, 1))), means, np.full((30, 2, 3, 1), 50.0))
    assert recognise.solve_trajectory(densities)[0] == pytest.approx(np.ones((30, 1)), abs=0.05)
    assert recognise.solve_trajectory(densities, iterations=1)[0] == pytest.approx(0.2, abs=0.05)


def test_the_densities_are_those_of_the_leaves_in_units_of_the_motion():
    components = 3
    hmm = random_joint(1, components=components, states=2)
    path = recognise.align(hmm, observed(np.random.default_rng(2), 9), ("sil", "a", "b"))
    found, model = recognise.select_densities(hmm, path), hmm.models[MOTION]
    leaves = model.forest.leaves(path.states.triphones)[path.frames]
    middle = 4
    wanted = model.tied.mixtures.means[leaves[middle]] * model.scale.deviation + model.scale.mean
    assert found.means[middle] == pytest.approx(wanted.reshape(components, 3, 2))
    variance = model.tied.mixtures.variances[leaves[middle]] * model.scale.deviation**2
    assert found.precisions[middle] == pytest.approx(1 / variance.reshape(components, 3, 2), rel=1e-6)
    assert (found.precisions[[0, -1], :, 1:] == 0).all()
