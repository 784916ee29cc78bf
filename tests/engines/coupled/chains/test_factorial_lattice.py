from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from engines.coupled.tiny import THREE, TWO, chains, observations, structure
from engines.coupled.training.test_training import sentences
from lipmotion.engines.coupled.chains import densities, model, structures
from lipmotion.engines.coupled.chains.lattice import FactorialProduct, FactorialTransitions
from lipmotion.engines.coupled.conversion.em_conversion import ConversionSettings, convert
from lipmotion.engines.coupled.training.chain_training import (
    LEAST_FRAMES,
    MixtureSchedule,
    growing_chains,
    with_joint_state_densities,
)


def both(seed=0) -> tuple[model.Chains, model.Chains]:
    """The same factorial HMM with a listed product and without; three joint states have densities of their own."""
    listed = chains(structure(structures.FACTORIAL, (THREE, TWO), limit=None), seed=seed)
    product = listed.transitions.product
    visits = np.zeros(len(product.joint_states))
    visits[[0, 5, 17]] = 100
    free = with_joint_state_densities(listed, replace(listed.transitions), visits, product.structure)
    assert isinstance(free.transitions, FactorialTransitions)
    draw = np.random.default_rng(seed)
    groups = []
    for group in free.groups:
        moved = group.mixtures.copy()
        moved.means[-3:] += draw.normal(0, 1, moved.means[-3:].shape).astype(np.float32)
        groups.append(replace(group, mixtures=moved))
    free = replace(free, groups=tuple(groups))
    return penalised(listed, groups), free


def penalised(listed: model.Chains, groups) -> model.Chains:
    """Listed chains with the same penalty for joint states without densities of their own."""
    speech = groups[0].mixtures.copy()
    speech.log_weights[:-3] -= structures.UNSEEN_LOSS
    return replace(listed, groups=(replace(groups[0], mixtures=speech), *groups[1:]))


@pytest.mark.long
def test_posteriors_and_paths_are_those_of_the_listed_product():
    for seed, seen in ((0, True), (1, False)):
        listed, free = both(seed)
        data = observations(9, seed=seed, seen=seen)
        one, other = (
            x.posteriors(x.emission_log_densities(data, x.full_lattice), x.full_lattice) for x in (listed, free)
        )
        assert other.log_likelihood == pytest.approx(one.log_likelihood, rel=1e-5)
        for chain in range(2):
            np.testing.assert_allclose(other.chains[chain], one.chains[chain], atol=2e-5)
        for number, lattice in enumerate((free.full_lattice, free.full_lattice)):
            full = np.zeros(one.densities[number].shape)
            full[:, lattice.densities[number]] = other.densities[number]
            np.testing.assert_allclose(full, one.densities[number], atol=2e-5)
        path, score = free.best_path(free.emission_log_densities(data, free.full_lattice), free.full_lattice)
        same, value = listed.best_path(listed.emission_log_densities(data, listed.full_lattice), listed.full_lattice)
        np.testing.assert_array_equal(path, same)
        assert score == pytest.approx(value, rel=1e-4)


def test_conversion_is_the_same():
    listed, free = both()
    data = observations(8)
    for update in ("exact", "printed"):
        results = [convert(x, data, x.full_lattice, ConversionSettings("soft", update, 3)) for x in (listed, free)]
        np.testing.assert_allclose(results[0].streams[1], results[1].streams[1], rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("loss", [0.0, structures.UNSEEN_LOSS])
def test_densities_integrate_to_1_without_a_loss(loss):
    """As printed, those of every joint state; with the option, rare ones lose that share, and frequent ones nothing."""
    of = replace(structure(structures.FACTORIAL, (THREE, TWO), limit=None), unseen_loss=loss)
    listed = chains(of, sizes=(1, 1))
    visits = np.where(np.arange(len(listed.transitions.product.joint_states)) < 4, LEAST_FRAMES, LEAST_FRAMES - 1)
    free = with_joint_state_densities(listed, listed.transitions, visits, of)
    assert len(free.transitions.own_density_states) == 4
    grid = np.linspace(-15, 15, 3001, dtype=np.float32)[:, None]
    logs = free.emission_log_densities(densities.AudioVisualObservations((grid, grid), (None, None)), free.full_lattice)
    first, second = (np.exp(log.astype(float)).sum(axis=0) * 0.01 for log in logs.log_densities)
    np.testing.assert_allclose(first[-4:] * second[-4:], 1, rtol=1e-3)
    np.testing.assert_allclose(np.outer(first[:-4], second[:-4]), np.exp(-loss), rtol=1e-3)


def test_counts_are_of_moving_on_and_staying():
    listed, free = both()
    data = observations(9)
    one, other = (x.posteriors(x.emission_log_densities(data, x.full_lattice), x.full_lattice) for x in (listed, free))
    counts = np.zeros(free.transitions.statistic_count)
    counts[free.full_lattice.transition_index] = other.transition_counts
    better, same = listed.transitions.reestimated(one.transition_counts), free.transitions.reestimated(counts)
    for chain in range(2):
        np.testing.assert_allclose(same.advance[chain], better.advance[chain], atol=2e-4)


def test_only_allowed_units_are_in_the_lattice_and_visual_ones_a_little_before_and_after():
    _, free = both()
    allowed = np.zeros((40, 3), bool)
    first, second = free.structure.units[0].index("closed"), free.structure.units[0].index("open")
    allowed[:20, first] = True
    allowed[20:, second] = True
    lattice = free.lattice(allowed)
    found = free.posteriors(free.emission_log_densities(observations(40), lattice), lattice)
    states = free.structure.states
    assert found.chains[0][:20].reshape(20, -1, states)[:, second].max() == 0
    seen = found.chains[1].reshape(40, -1, states)
    shut = free.structure.units[1].index("closed")
    assert seen[31:, shut].max() == 0
    assert seen[20:29, shut].max() > 0
    np.testing.assert_allclose(found.chains[1].sum(axis=1), 1, atol=1e-5)


def test_training_without_a_limit_rises_at_every_step():
    steps = []
    of = structure(structures.FACTORIAL, (THREE, TWO), states=3, limit=None)
    *_, grown = growing_chains(
        of, ("speech", "seen"), sentences(), MixtureSchedule((2, 2), (1.0, 1.0), most_steps=6), steps.append
    )
    trained = grown.model
    assert isinstance(trained.transitions, FactorialTransitions)
    assert len(trained.transitions.own_density_states) > 5
    for one, other in pairwise(steps):
        if one.mixtures == other.mixtures:
            assert other.log_likelihood >= one.log_likelihood - 1e-5


def test_joint_states_have_names():
    of = structure(structures.FACTORIAL, (THREE, TWO), limit=None)
    free = FactorialProduct(of, chains(of).transitions.product.grammar)
    assert free.name(0) == f"{of.units[0][0]}.1 | {of.units[1][0]}.1"
    assert free.name(of.state_counts[1] + 1) == f"{of.units[0][0]}.2 | {of.units[1][0]}.2"
