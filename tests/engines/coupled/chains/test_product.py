from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from engines.coupled import tiny
from engines.coupled.tiny import grammar, structure
from lipmotion.engines import create_engine
from lipmotion.engines.coupled.chains import densities, model
from lipmotion.engines.coupled.chains.lattice import FactorialTransitions
from lipmotion.engines.coupled.chains.product import (
    UNSEEN_LOSS,
    JointState,
    Transitions,
    create_transitions,
    find_reachable,
    list_unit_sets,
)
from lipmotion.engines.coupled.conversion import convert, sum_precisions
from lipmotion.engines.coupled.training.chain_training import MIN_FRAMES, with_joint_state_densities
from lipmotion.errors import InputError
from oracles import coupled as oracle


def even(of):
    return find_reachable(of, grammar(of))


@pytest.mark.parametrize(
    ("system", "cross_units", "joints"),
    [
        ("ph-MSHMM", True, 235),
        pytest.param("ph-CHMM", True, 611 + 2 * 47 * 47, marks=pytest.mark.long),
        ("ph-vi-CHMM", True, 611 + 2 * 47 * 13),
        ("ph-vi-CHMM", False, 611),
    ],
)
def test_joint_states_of_the_papers_systems(system, cross_units, joints):
    """47 × (5 + 4 + 4) when all leave a unit together; beyond that, one chain waits in the last state for the other."""
    config = create_engine(preset=system, settings=[f"cross_units={cross_units}"]).config
    of = config.structure_with(list_unit_sets(config.chains))
    assert len(even(of).joint_states) == joints


def test_chains_are_never_farther_apart_than_the_limit():
    for limit, cross_units in ((0, True), (1, False), (2, True)):
        of = structure(states=3, limit=limit, cross_units=cross_units)
        reached = even(of)
        spread = reached.lead.max(axis=0) - reached.lead.min(axis=0)
        assert spread.max() == limit
        if not cross_units:
            assert not any(any(joint.ahead) for joint in reached.joint_states)


def test_arcs_are_those_of_the_definition():
    """Each chain stays or moves one state on, no skips; a chain that is behind must enter the unit that is begun."""
    of = structure(states=2, limit=1)
    reached = even(of)
    arcs = set(zip(reached.arc_from.tolist(), reached.arc_to.tolist(), strict=True))
    for source, target in product(range(len(reached.joint_states)), repeat=2):
        assert ((source, target) in arcs) is possible(of, reached.joint_states[source], reached.joint_states[target])


def possible(of, before: JointState, after: JointState) -> bool:
    """Whether some sequence of units, and a position in it for each chain, lead from one joint state to the other."""
    units, count = range(len(of.units[0])), of.states
    for old, new, newer in product(units, repeat=3):
        sequence = [old, new, newer]
        for start in product(range(2 * count), repeat=2):
            if not fits(of, before, sequence, start):
                continue
            for moved in product((0, 1), repeat=2):
                end = [a + b for a, b in zip(start, moved, strict=True)]
                if max(end) - min(end) <= of.limit and fits(of, after, sequence, end, relative=True):
                    return True
    return False


def fits(of, joint: JointState, sequence, positions, relative=False) -> bool:
    units = [position // of.states for position in positions]
    first = min(units)
    if not relative and first != 0:
        return False
    if max(units) - first > 1:
        return False
    return all(
        joint.states[c] == positions[c] % of.states
        and joint.units[c] == of.corresponding_units[c][sequence[units[c]]]
        and joint.ahead[c] == (units[c] > first)
        for c in range(2)
    )


def test_the_next_unit_has_the_probability_of_the_bigram():
    """Whichever chain enters first: P(next unit of the first chain | its last unit) is that of the bigram."""
    of = structure(states=2, limit=1)
    reached = even(of)
    bigram, last = reached.grammar.bigrams[0], of.states - 1
    for unit in range(len(of.units[0])):
        together = reached.joint_states.index(
            JointState((unit, of.corresponding_units[1][unit]), (last, last), (False, False))
        )
        out = reached.arc_from == together
        both = out & reached.moves.all(axis=0)
        for entered in range(len(of.units[0])):
            target = reached.joint_states.index(
                JointState((entered, of.corresponding_units[1][entered]), (0, 0), (False, False))
            )
            assert reached.unit_probability[both & (reached.arc_to == target)] == pytest.approx(bigram[unit, entered])
        visual_first = out & ~reached.moves[0] & reached.moves[1]
        assert reached.unit_probability[visual_first].sum() == pytest.approx(1)
        for arc in np.flatnonzero(visual_first):
            waiting = reached.joint_states[reached.arc_to[arc]]
            alike = [u for u in range(len(of.units[0])) if of.corresponding_units[1][u] == waiting.units[1]]
            assert reached.unit_probability[arc] == pytest.approx(bigram[unit, alike].sum())
            follow = (reached.arc_from == reached.arc_to[arc]) & reached.moves[0] & ~reached.moves[1]
            for after in np.flatnonzero(follow):
                entered = reached.joint_states[reached.arc_to[after]].units[0]
                expected = bigram[unit, entered] / bigram[unit, alike].sum()
                assert reached.unit_probability[after] == pytest.approx(expected)


@pytest.mark.parametrize("kind", [tiny.COUPLED, tiny.FACTORIAL])
def test_probabilities_out_of_every_state_sum_to_one(kind):
    transitions = create_transitions(even(structure(kind)))
    left = np.bincount(transitions.product.arc_from, np.exp(transitions.arc_log))
    np.testing.assert_allclose(left, 1, rtol=1e-12)
    one_chain = even(structure(tiny.HMM, (tiny.THREE,), states=3, limit=1))  # the HMM of its units
    assert len(one_chain.joint_states) == 9
    assert len(one_chain.arc_from) == 9 + 6 + 9  # stay, move within, enter


def test_structures_that_do_not_fit_together():
    for kind, sets, limit, message in (
        (tiny.MULTISTREAM, (tiny.THREE, tiny.TWO), 1, "2 chains"),
        (tiny.COUPLED, (tiny.THREE,), 1, "1 chains"),
        (tiny.COUPLED, (tiny.THREE, tiny.TWO), 2, "required 0 to 1"),
        (tiny.COUPLED, (tiny.THREE, tiny.TWO), None, "no limit"),
    ):
        with pytest.raises(InputError, match=message):
            structure(kind, sets, states=2, limit=limit)
    with pytest.raises(InputError, match="no chains"):
        list_unit_sets(" ")


def expected_log_likelihood(transitions: Transitions, counts) -> float:
    """The part of the expected log likelihood that depends on the tables."""
    return float(counts @ transitions.arc_log)


@pytest.mark.parametrize(
    ("kind", "sets", "limit"),
    [
        (tiny.COUPLED, (tiny.THREE, tiny.TWO), 1),
        (tiny.FACTORIAL, (tiny.THREE, tiny.TWO), 1),
        (tiny.HMM, (tiny.THREE,), 1),
    ],
)
def test_no_other_tables_have_a_higher_expected_likelihood(kind, sets, limit):
    transitions = tiny.chains(structure(kind, sets, limit=limit)).transitions
    counts = np.random.default_rng(0).gamma(0.5, 20, len(transitions.product.arc_from))
    best = transitions.reestimated(counts)
    value = expected_log_likelihood(best, counts)
    assert value > expected_log_likelihood(transitions, counts)
    draw = np.random.default_rng(1)
    for size in np.repeat((1e-3, 1e-2, 0.1), 8):
        changes = (size * draw.normal(size=a.shape) * a * (1 - a) for a in best.advance)
        moved = tuple(np.clip(a + step, 1e-5, 1 - 1e-5) for a, step in zip(best.advance, changes, strict=True))
        other = expected_log_likelihood(Transitions(best.product, best.rows, moved), counts)
        assert other <= value + 1e-6 * abs(value)


def test_rare_joint_states_share_the_rows_of_their_own_state_and_lead():
    transitions = tiny.chains().transitions
    product, frames = transitions.product, np.zeros(len(transitions.product.joint_states))
    frames[:4] = 1000
    tied = transitions.tied(frames)
    for chain in range(2):
        rows = tied.rows[chain]
        assert len(set(rows[:4])) == 4
        alike = [
            (product.chain_states[chain][s], *product.lead[:, s] - product.lead[chain, s]) for s in range(len(rows))
        ]
        for one in range(4, len(rows)):
            for other in range(4, len(rows)):
                assert bool(rows[one] == rows[other]) is (alike[one] == alike[other])
    even_tables = Transitions(product, transitions.rows, tuple(np.full_like(a, 0.3) for a in transitions.advance))
    np.testing.assert_allclose(even_tables.tied(0 * frames).arc_log, even_tables.arc_log)


every = pytest.mark.parametrize(("kind", "sets", "limit"), tiny.KINDS)


def made(kind, sets, limit, **other):
    return tiny.chains(structure(kind, sets, limit=limit), **other)


@every
@pytest.mark.parametrize("seen", [True, False, 0.5])
def test_posteriors_are_those_of_all_paths(kind, sets, limit, seen):
    model, data = made(kind, sets, limit), tiny.observations(seen=seen)
    lattice = model.full_lattice
    result = model.infer(data, lattice).posteriors
    joint, counts, log_likelihood = oracle.posteriors(model, data)
    for chain, states in enumerate(model.transitions.product.chain_states):
        for state in range(model.structure.state_counts[chain]):
            np.testing.assert_allclose(result.chains[chain][:, state], joint[:, states == state].sum(axis=1), atol=2e-5)
    np.testing.assert_array_equal(result.most_probable, joint.argmax(axis=1))
    assert result.log_likelihood == pytest.approx(log_likelihood, rel=1e-5)
    product = model.transitions.product
    expected = [counts.get(pair, 0.0) for pair in zip(product.arc_from.tolist(), product.arc_to.tolist(), strict=True)]
    np.testing.assert_allclose(result.transition_counts, expected, atol=5e-5)
    for number, group in enumerate(model.groups):
        for density in range(group.mixtures.size[0]):
            np.testing.assert_allclose(
                result.densities[number][:, density], joint[:, group.tie == density].sum(axis=1), atol=2e-5
            )


@every
def test_the_best_path_is_the_best_of_all(kind, sets, limit):
    model, data = made(kind, sets, limit), tiny.observations()
    path, score = model.best_path(data, model.full_lattice)
    best, value = max(oracle.paths(model, data), key=lambda pair: pair[1])
    assert tuple(path) == best
    assert score == pytest.approx(value, rel=1e-4)


@every
def test_expected_precisions_and_means(kind, sets, limit):
    model, data = made(kind, sets, limit), tiny.observations()
    precision, weighted = sum_precisions(model, model.infer(data, model.full_lattice), 1)
    number = 0 if kind == tiny.HMM else 1
    expected = oracle.component_statistics(model, data, number, 1)
    np.testing.assert_allclose(precision, expected[0], rtol=1e-4)
    np.testing.assert_allclose(weighted, expected[1], rtol=1e-3, atol=1e-4)


def test_a_lattice_of_all_units_is_the_full_one_and_a_smaller_one_excludes_paths():
    model, data = made(tiny.COUPLED, (tiny.THREE, tiny.TWO), 1), tiny.observations(5)
    product = model.transitions.product
    allowed = np.ones((5, 3), bool)
    result = model.infer(data, model.full_lattice).posteriors
    free = model.lattice(allowed)
    same = model.infer(data, free).posteriors
    assert same.log_likelihood == pytest.approx(result.log_likelihood, rel=1e-6)
    allowed[:, 1] = False
    allowed[2:, 2] = False
    part = model.lattice(allowed)
    less = model.infer(data, part).posteriors
    paths = [
        (path, score)
        for path, score in oracle.paths(model, data)
        if all(allowed[t, product.joint_states[state].units[0]] for t, state in enumerate(path))
    ]
    assert less.log_likelihood == pytest.approx(np.logaddexp.reduce([score for _, score in paths]), rel=1e-5)
    np.testing.assert_allclose(less.chains[0].sum(axis=1), 1, atol=1e-5)


def both(seed=0) -> tuple[model.Chains, model.Chains]:
    """The same factorial HMM with a listed product and without; three joint states have densities of their own."""
    listed = tiny.chains(structure(tiny.FACTORIAL, (tiny.THREE, tiny.TWO), limit=None), seed=seed)
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
    speech.log_weights[:-3] -= UNSEEN_LOSS
    return replace(listed, groups=(replace(groups[0], mixtures=speech), *groups[1:]))


@pytest.mark.long
def test_posteriors_and_paths_are_those_of_the_listed_product():
    for seed, seen in ((0, True), (1, False)):
        listed, free = both(seed)
        data = tiny.observations(9, seed=seed, seen=seen)
        one, other = (x.infer(data, x.full_lattice).posteriors for x in (listed, free))
        assert other.log_likelihood == pytest.approx(one.log_likelihood, rel=1e-5)
        for chain in range(2):
            np.testing.assert_allclose(other.chains[chain], one.chains[chain], atol=2e-5)
        for number, lattice in enumerate((free.full_lattice, free.full_lattice)):
            full = np.zeros(one.densities[number].shape)
            full[:, lattice.densities[number]] = other.densities[number]
            np.testing.assert_allclose(full, one.densities[number], atol=2e-5)
        path, score = free.best_path(data, free.full_lattice)
        same, value = listed.best_path(data, listed.full_lattice)
        np.testing.assert_array_equal(path, same)
        assert score == pytest.approx(value, rel=1e-4)


def test_conversion_is_the_same():
    listed, free = both()
    data = tiny.observations(8)
    for update in ("exact", "printed"):
        results = [convert(x, data, x.full_lattice, "soft", update, 3)[0] for x in (listed, free)]
        np.testing.assert_allclose(results[0][0], results[1][0], rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("loss", [0.0, UNSEEN_LOSS])
def test_densities_integrate_to_1_without_a_loss(loss):
    """As printed, those of every joint state; with the option, rare ones lose that share, and frequent ones nothing."""
    of = replace(structure(tiny.FACTORIAL, (tiny.THREE, tiny.TWO), limit=None), unseen_loss=loss)
    listed = tiny.chains(of, sizes=(1, 1))
    visits = np.where(np.arange(len(listed.transitions.product.joint_states)) < 4, MIN_FRAMES, MIN_FRAMES - 1)
    free = with_joint_state_densities(listed, listed.transitions, visits, of)
    assert len(free.transitions.own_density_states) == 4
    grid = np.linspace(-15, 15, 3001, dtype=np.float32)[:, None]
    data = densities.AudioVisualObservations((grid, grid), (None, None))
    logs, _ = free.log_densities(data, free.full_lattice)
    first, second = (np.exp(log.astype(float)).sum(axis=0) * 0.01 for log in logs)
    np.testing.assert_allclose(first[-4:] * second[-4:], 1, rtol=1e-3)
    np.testing.assert_allclose(np.outer(first[:-4], second[:-4]), np.exp(-loss), rtol=1e-3)


def test_counts_are_of_moving_on_and_staying():
    listed, free = both()
    data = tiny.observations(9)
    one, other = (x.infer(data, x.full_lattice).posteriors for x in (listed, free))
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
    found = free.infer(tiny.observations(40), lattice).posteriors
    states = free.structure.states
    assert found.chains[0][:20].reshape(20, -1, states)[:, second].max() == 0
    seen = found.chains[1].reshape(40, -1, states)
    shut = free.structure.units[1].index("closed")
    assert seen[31:, shut].max() == 0
    assert seen[20:29, shut].max() > 0
    np.testing.assert_allclose(found.chains[1].sum(axis=1), 1, atol=1e-5)
