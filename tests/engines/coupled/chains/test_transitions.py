import numpy as np
import pytest

from engines.coupled.tiny import THREE, TWO, chains, structure
from lipmotion.engines.coupled.chains.structures import COUPLED, FACTORIAL, HMM
from lipmotion.engines.coupled.chains.transitions import Transitions


def explained(transitions: Transitions, counts) -> float:
    """The part of the expected log likelihood that depends on the tables."""
    return float(counts @ transitions.arc_log)


def random_counts(transitions, seed=0):
    return np.random.default_rng(seed).gamma(0.5, 20, len(transitions.product.arc_from))


@pytest.mark.parametrize(
    ("kind", "sets", "limit"),
    [(COUPLED, (THREE, TWO), 1), (FACTORIAL, (THREE, TWO), 1), (COUPLED, (THREE, TWO), None), (HMM, (THREE,), 1)],
)
def test_no_other_tables_explain_the_counts_better(kind, sets, limit):
    found = chains(structure(kind, sets, limit=limit)).transitions
    counts = random_counts(found)
    best = found.reestimated(counts)
    value = explained(best, counts)
    assert value > explained(found, counts)
    draw = np.random.default_rng(1)
    for size in (1e-3, 1e-2, 0.1):
        for _ in range(20):
            moved = tuple(
                np.clip(a + size * draw.normal(size=a.shape) * a * (1 - a), 1e-5, 1 - 1e-5) for a in best.advance
            )
            assert explained(Transitions(best.product, best.rows, moved), counts) <= value + 1e-6 * abs(value)


def test_without_a_mask_it_is_the_closed_form():
    found = chains(structure(HMM, (THREE,), limit=1)).transitions
    counts = random_counts(found)
    best = found.reestimated(counts)
    left = np.bincount(found.product.arc_from, counts)
    moved = np.bincount(found.product.arc_from, counts * found.product.moves[0])
    np.testing.assert_allclose(best.advance[0][best.rows[0]], moved / left, atol=1e-6)


def test_rows_without_data_stay():
    found = chains().transitions
    counts = random_counts(found)
    unseen = found.product.arc_from == 3
    counts[unseen] = 0
    best = found.reestimated(counts)
    for chain in range(2):
        assert best.advance[chain][best.rows[chain][3]] == found.advance[chain][found.rows[chain][3]]


def test_rare_joint_states_share_the_rows_of_their_own_state_and_lead():
    found = chains().transitions
    frames = np.zeros(len(found.product.joint_states))
    frames[:4] = 1000
    tied = found.tied(frames)
    for chain in range(2):
        rows = tied.rows[chain]
        assert len(set(rows[:4])) == 4
        alike = [
            (found.product.chain_states[chain][s], *found.product.lead[:, s] - found.product.lead[chain, s])
            for s in range(len(rows))
        ]
        for one in range(4, len(rows)):
            for other in range(4, len(rows)):
                assert bool(rows[one] == rows[other]) is (alike[one] == alike[other])


def test_tied_tables_keep_their_probabilities_where_alike():
    found = chains().transitions
    even = Transitions(found.product, found.rows, tuple(np.full_like(a, 0.3) for a in found.advance))
    np.testing.assert_allclose(even.tied(np.zeros(len(found.product.joint_states))).arc_log, even.arc_log)
