from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmm.multistream.synthetic import CLASSES, config, inventory, observed, random_joint, utterances
from lipmotion.errors import InputError
from lipmotion.hmm.multistream import generate
from lipmotion.hmm.multistream.densities import MOTION, SPEECH
from lipmotion.hmm.multistream.model import ACOUSTIC_ONLY
from lipmotion.hmm.multistream.multistream_training import train_joint
from lipmotion.hmm.multistream.recognise import align
from lipmotion.stats.curves import with_dynamics
from oracles import trajectories


def random_densities(seed, frames, components, dimensions=2):
    draw = np.random.default_rng(seed)
    precisions = draw.uniform(0.2, 9, (frames, components, 3, dimensions))
    precisions[[0, -1], :, 1:] = 0
    return generate.FrameDensities(
        np.log(draw.dirichlet(np.full(components, 2.0), frames)),
        draw.normal(0, 2, (frames, components, 3, dimensions)),
        precisions,
    )


@settings(max_examples=30)
@given(frames=st.integers(1, 12), seed=st.integers(0, 50), pinned=st.booleans())
def test_one_gaussian_has_the_closed_form(frames, seed, pinned):
    densities = random_densities(seed, frames, 1)
    pins = {(frames // 2, 0): 1.5, (frames // 2, 1): -0.5, (0, 1): 0.25} if pinned else {}
    found = generate.solve_trajectory(densities, pins)
    for channel in range(2):
        mine = [(frame, value) for (frame, c), value in pins.items() if c == channel]
        mean, precision = densities.means[:, 0, :, channel], densities.precisions[:, 0, :, channel]
        values, variance = trajectories.generate(mean, precision, mine)
        assert found.values[:, channel] == pytest.approx(values, abs=1e-8)
        assert found.variance[:, channel] == pytest.approx(variance, abs=1e-8)
    assert len(found.log_likelihoods) == 1


def test_many_steps_over_one_gaussian_change_nothing():
    one = random_densities(1, 15, 1)
    twins = generate.FrameDensities(
        np.full((15, 2), np.log(0.5)), one.means.repeat(2, axis=1), one.precisions.repeat(2, axis=1)
    )
    found, wanted = generate.solve_trajectory(twins), generate.solve_trajectory(one)
    assert found.values == pytest.approx(wanted.values, abs=1e-9)
    assert found.log_likelihoods[-1] == pytest.approx(wanted.log_likelihoods[0], abs=1e-9)


@settings(max_examples=30)
@given(frames=st.integers(1, 25), components=st.integers(2, 4), seed=st.integers(0, 50), pinned=st.booleans())
def test_the_likelihood_of_the_trajectory_never_falls(frames, components, seed, pinned):
    densities = random_densities(seed, frames, components)
    pins = {(frames - 1, 0): 0.3} if pinned else {}
    found = generate.solve_trajectory(densities, pins, iterations=50)
    assert (np.diff(found.log_likelihoods) > -1e-9 * frames).all()
    assert found.log_likelihoods[-1] == pytest.approx(slow_log_likelihood(densities, found.values), abs=1e-8)
    for (frame, channel), value in pins.items():
        assert found.values[frame, channel] == value


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
    densities = generate.FrameDensities(np.log(np.tile([0.6, 0.4], (30, 1))), means, np.full((30, 2, 3, 1), 50.0))
    assert generate.solve_trajectory(densities).values == pytest.approx(np.ones((30, 1)), abs=0.05)
    assert generate.solve_trajectory(densities, iterations=1).values == pytest.approx(0.2, abs=0.05)


def test_the_densities_are_those_of_the_leaves_in_units_of_the_motion():
    components = 3
    hmm = random_joint(1, components=components, states=2)
    path = align(hmm, observed(np.random.default_rng(2), 9), ("sil", "a", "b"))
    found, model = generate.select_densities(hmm, path), hmm.models[MOTION]
    leaves = model.forest.leaves(path.states.triphones)[path.frames]
    middle = 4
    wanted = model.tied.mixtures.means[leaves[middle]] * model.scale.deviation + model.scale.mean
    assert found.means[middle] == pytest.approx(wanted.reshape(components, 3, 2))
    variance = model.tied.mixtures.variances[leaves[middle]] * model.scale.deviation**2
    assert found.precisions[middle] == pytest.approx(1 / variance.reshape(components, 3, 2), rel=1e-6)
    assert (found.precisions[[0, -1], :, 1:] == 0).all()


def test_what_was_learned_comes_back():
    hmm = train_joint(utterances(30), inventory(), CLASSES, config())
    for each in utterances(4, seed=9):
        motion, path = each.observed.streams[MOTION], align(hmm, each.observed, each.units, each.bounds)
        off = generate.solve_trajectory(generate.select_densities(hmm, path)).values - motion.values[:, :2]
        assert np.sqrt((off[motion.known] ** 2).mean(axis=0)) == pytest.approx([0.06, 0.03], abs=0.05)


def test_what_cannot_be_generated():
    deaf, hmm = random_joint(7, streams=(SPEECH,)), random_joint(8, synthesis=ACOUSTIC_ONLY)
    data = observed(np.random.default_rng(9), 9)
    for model in (deaf, hmm):
        with pytest.raises(InputError, match="no motion, or it is switched off"):
            generate.select_densities(model, align(model, data, ("a",)))
    hmm = replace(hmm, config=config())
    with pytest.raises(InputError, match="a pin at"):
        generate.solve_trajectory(random_densities(0, 5, 1), {(5, 0): 1.0})
