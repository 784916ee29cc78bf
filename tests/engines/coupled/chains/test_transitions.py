import numpy as np

from engines.coupled.tiny import THREE, TWO, chains, structure
from lipmotion.engines.coupled.chains.product import Transitions
from lipmotion.engines.coupled.chains.structures import COUPLED, FACTORIAL, HMM


def expected_log_likelihood(transitions: Transitions, counts) -> float:
    """The part of the expected log likelihood that depends on the tables."""
    return float(counts @ transitions.arc_log)


def random_counts(transitions, seed=0):
    return np.random.default_rng(seed).gamma(0.5, 20, len(transitions.product.arc_from))


def test_no_other_tables_have_a_higher_expected_likelihood():
    for kind, sets, limit in (
        (COUPLED, (THREE, TWO), 1),
        (FACTORIAL, (THREE, TWO), 1),
        (COUPLED, (THREE, TWO), None),
        (HMM, (THREE,), 1),
    ):
        transitions = chains(structure(kind, sets, limit=limit)).transitions
        counts = random_counts(transitions)
        best = transitions.reestimated(counts)
        value = expected_log_likelihood(best, counts)
        assert value > expected_log_likelihood(transitions, counts)
        draw = np.random.default_rng(1)
        for size in (1e-3, 1e-2, 0.1):
            for _ in range(8):
                moved = tuple(
                    np.clip(a + size * draw.normal(size=a.shape) * a * (1 - a), 1e-5, 1 - 1e-5) for a in best.advance
                )
                assert expected_log_likelihood(
                    Transitions(best.product, best.rows, moved), counts
                ) <= value + 1e-6 * abs(value)


def test_without_a_mask_it_is_the_closed_form():
    transitions = chains(structure(HMM, (THREE,), limit=1)).transitions
    counts = random_counts(transitions)
    best = transitions.reestimated(counts)
    left = np.bincount(transitions.product.arc_from, counts)
    moved = np.bincount(transitions.product.arc_from, counts * transitions.product.moves[0])
    np.testing.assert_allclose(best.advance[0][best.rows[0]], moved / left, atol=1e-6)


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
    frames = np.zeros(len(transitions.product.joint_states))
    frames[:4] = 1000
    tied = transitions.tied(frames)
    for chain in range(2):
        rows = tied.rows[chain]
        assert len(set(rows[:4])) == 4
        alike = [
            (
                transitions.product.chain_states[chain][s],
                *transitions.product.lead[:, s] - transitions.product.lead[chain, s],
            )
            for s in range(len(rows))
        ]
        for one in range(4, len(rows)):
            for other in range(4, len(rows)):
                assert bool(rows[one] == rows[other]) is (alike[one] == alike[other])


def test_tied_tables_keep_their_probabilities_where_alike():
    transitions = chains().transitions
    even = Transitions(transitions.product, transitions.rows, tuple(np.full_like(a, 0.3) for a in transitions.advance))
    np.testing.assert_allclose(even.tied(np.zeros(len(transitions.product.joint_states))).arc_log, even.arc_log)
