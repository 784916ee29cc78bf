from itertools import product

import numpy as np
import pytest

from engines.coupled.tiny import THREE, TWO, chains, grammar, structure
from lipmotion.engines.coupled.chains.product import JointState, Transitions, initial_transitions, reachable
from lipmotion.engines.coupled.chains.structures import COUPLED, FACTORIAL, HMM, MULTISTREAM, SYSTEMS, unit_sets
from lipmotion.engines.coupled.model import CoupledConfig
from lipmotion.errors import InputError


def even(of):
    return reachable(of, grammar(of))


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
    config = CoupledConfig(**SYSTEMS[system] | {"cross_units": cross_units})
    of = config.structure_with(unit_sets(config.chains))
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


@pytest.mark.parametrize("kind", [COUPLED, FACTORIAL])
def test_probabilities_out_of_every_state_sum_to_one(kind):
    transitions = initial_transitions(even(structure(kind)))
    left = np.bincount(transitions.product.arc_from, np.exp(transitions.arc_log))
    np.testing.assert_allclose(left, 1, rtol=1e-12)
    one_chain = even(structure(HMM, (THREE,), states=3, limit=1))  # the HMM of its units
    assert len(one_chain.joint_states) == 9
    assert len(one_chain.arc_from) == 9 + 6 + 9  # stay, move within, enter


def test_structures_that_do_not_fit_together():
    for kind, sets, limit, message in (
        ("ring", (THREE,), 1, "ring"),
        (MULTISTREAM, (THREE, TWO), 1, "2 chains"),
        (COUPLED, (THREE,), 1, "1 chains"),
        (COUPLED, (THREE, TWO), 2, "required 0 to 1"),
        (COUPLED, (THREE, TWO), None, "no limit"),
    ):
        with pytest.raises(InputError, match=message):
            structure(kind, sets, states=2, limit=limit)
    with pytest.raises(InputError, match="no chains"):
        unit_sets(" ")


def expected_log_likelihood(transitions: Transitions, counts) -> float:
    """The part of the expected log likelihood that depends on the tables."""
    return float(counts @ transitions.arc_log)


def random_counts(transitions, seed=0):
    return np.random.default_rng(seed).gamma(0.5, 20, len(transitions.product.arc_from))


@pytest.mark.parametrize(
    ("kind", "sets", "limit"),
    [(COUPLED, (THREE, TWO), 1), (FACTORIAL, (THREE, TWO), 1), (HMM, (THREE,), 1)],
)
def test_no_other_tables_have_a_higher_expected_likelihood(kind, sets, limit):
    transitions = chains(structure(kind, sets, limit=limit)).transitions
    counts = random_counts(transitions)
    best = transitions.reestimated(counts)
    value = expected_log_likelihood(best, counts)
    assert value > expected_log_likelihood(transitions, counts)
    draw = np.random.default_rng(1)
    for size in np.repeat((1e-3, 1e-2, 0.1), 8):
        changes = (size * draw.normal(size=a.shape) * a * (1 - a) for a in best.advance)
        moved = tuple(np.clip(a + step, 1e-5, 1 - 1e-5) for a, step in zip(best.advance, changes, strict=True))
        other = expected_log_likelihood(Transitions(best.product, best.rows, moved), counts)
        assert other <= value + 1e-6 * abs(value)


def test_rows_without_data_stay():
    transitions = chains().transitions
    counts = random_counts(transitions)
    without_data = transitions.product.arc_from == 3
    counts[without_data] = 0
    best = transitions.reestimated(counts)
    for chain in range(2):
        assert best.advance[chain][best.rows[chain][3]] == transitions.advance[chain][transitions.rows[chain][3]]


def test_rare_joint_states_share_the_rows_of_their_own_state_and_lead():
    transitions = chains().transitions
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
