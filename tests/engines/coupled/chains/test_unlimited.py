"""Chains without a limit of asynchrony, whose joint states are not listed, against those whose are."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from engines.coupled.tiny import THREE, TWO, chains, observed, structure
from engines.coupled.training.test_training import sentences
from lipmotion.engines.coupled.chains.joint_densities import with_pairs
from lipmotion.engines.coupled.chains.model import Chains
from lipmotion.engines.coupled.chains.structures import FACTORIAL
from lipmotion.engines.coupled.chains.unlimited import UNSEEN, FreeProduct, FreeTransitions
from lipmotion.engines.coupled.conversion.em import Conversion, converted
from lipmotion.engines.coupled.training.train import Schedule, train_chains


def both(seed=0) -> tuple[Chains, Chains]:
    """The same factorial model, listed and not; three joint states have densities of their own."""
    listed = chains(structure(FACTORIAL, (THREE, TWO), limit=None), seed=seed)
    product = listed.transitions.product
    visits = np.zeros(len(product.joints))
    visits[[0, 5, 17]] = 100
    free = with_pairs(listed, replace(listed.transitions), visits, product.structure)
    assert isinstance(free.transitions, FreeTransitions)
    draw = np.random.default_rng(seed)
    groups = []
    for group in free.groups:
        moved = group.mixtures.copy()
        moved.means[-3:] += draw.normal(0, 1, moved.means[-3:].shape).astype(np.float32)
        groups.append(replace(group, mixtures=moved))
    free = replace(free, groups=tuple(groups))
    return unfavoured(listed, groups), free


def unfavoured(listed: Chains, groups) -> Chains:
    """Listed chains whose joint states without densities of their own lose as much as free ones do."""
    heard = groups[0].mixtures.copy()
    heard.log_weights[:-3] += UNSEEN
    return replace(listed, groups=(replace(groups[0], mixtures=heard), *groups[1:]))


@pytest.mark.parametrize("seen", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_what_is_not_listed_is_as_what_is(seed, seen):
    listed, free = both(seed)
    data = observed(9, seed=seed, seen=seen)
    one, other = (x.posteriors(x.evidence(data, x.everywhere), x.everywhere) for x in (listed, free))
    assert other.log_likelihood == pytest.approx(one.log_likelihood, rel=1e-5)
    for chain in range(2):
        np.testing.assert_allclose(other.chains[chain], one.chains[chain], atol=2e-5)
    for number, lattice in enumerate((free.everywhere, free.everywhere)):
        full = np.zeros(one.densities[number].shape)
        full[:, lattice.densities[number]] = other.densities[number]
        np.testing.assert_allclose(full, one.densities[number], atol=2e-5)
    path, score = free.best_path(free.evidence(data, free.everywhere), free.everywhere)
    same, value = listed.best_path(listed.evidence(data, listed.everywhere), listed.everywhere)
    np.testing.assert_array_equal(path, same)
    assert score == pytest.approx(value, rel=1e-4)


def test_conversion_is_the_same():
    listed, free = both()
    data = observed(8)
    for update in ("exact", "printed"):
        results = [converted(x, data, x.everywhere, Conversion("soft", update, 3)) for x in (listed, free)]
        np.testing.assert_allclose(results[0].streams[1], results[1].streams[1], rtol=1e-3, atol=1e-4)


def test_counts_are_those_of_moving_on_and_staying():
    listed, free = both()
    data = observed(9)
    one, other = (x.posteriors(x.evidence(data, x.everywhere), x.everywhere) for x in (listed, free))
    counts = np.zeros(free.transitions.count)
    counts[free.everywhere.counts] = other.counts
    better, same = listed.transitions.relearned(one.counts), free.transitions.relearned(counts)
    for chain in range(2):
        np.testing.assert_allclose(same.advance[chain], better.advance[chain], atol=2e-4)


def test_only_the_units_said_are_looked_at_and_may_be_seen_a_little_before_and_after():
    _, free = both()
    allowed = np.zeros((40, 3), bool)
    first, second = free.structure.units[0].index("closed"), free.structure.units[0].index("open")
    allowed[:20, first] = True
    allowed[20:, second] = True
    lattice = free.lattice(allowed)
    found = free.posteriors(free.evidence(observed(40), lattice), lattice)
    states = free.structure.states
    assert found.chains[0][:20].reshape(20, -1, states)[:, second].max() == 0
    seen = found.chains[1].reshape(40, -1, states)
    shut = free.structure.units[1].index("closed")
    assert seen[31:, shut].max() == 0
    assert seen[20:29, shut].max() > 0
    np.testing.assert_allclose(found.chains[1].sum(axis=1), 1, atol=1e-5)


def test_training_without_a_limit_rises_at_every_step():
    steps = []
    of = structure(FACTORIAL, (THREE, TWO), states=3, limit=None)
    trained = train_chains(of, ("speech", "seen"), sentences(), Schedule((2, 2), (1.0, 1.0), most=6), steps.append)
    assert isinstance(trained.transitions, FreeTransitions)
    assert len(trained.transitions.pairs) > 5
    for one, other in pairwise(steps):
        if one.mixtures == other.mixtures:
            assert other.log_likelihood >= one.log_likelihood - 1e-5


def test_joint_states_have_names():
    of = structure(FACTORIAL, (THREE, TWO), limit=None)
    free = FreeProduct(of, chains(of).transitions.product.grammar)
    assert free.name(0) == f"{of.units[0][0]}.1 | {of.units[1][0]}.1"
    assert free.name(of.counts[1] + 1) == f"{of.units[0][0]}.2 | {of.units[1][0]}.2"
