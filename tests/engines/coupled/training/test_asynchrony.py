"""Streams with a known lag: chains that may be apart must be better than one, and no worse without a lag."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from engines.coupled.tiny import THREE
from lipmotion.engines.coupled.chains import densities, model
from lipmotion.engines.coupled.chains.structures import COUPLED, FACTORIAL, MULTISTREAM, Structure
from lipmotion.engines.coupled.conversion.em_conversion import EXACT, VITERBI, ConversionSettings, convert
from lipmotion.engines.coupled.training.alignment import AlignedUtterance
from lipmotion.engines.coupled.training.chain_training import MixtureSchedule, growing_chains, lattice_utterance
from lipmotion.measures.curves import pooled_correlation
from lipmotion.types import Span, Timeline, Unit

STATES, PHONES = 3, ("p", "uw", "aa")
SEEN = np.array([(0.0, 0.0), (0.5, -2.0), (2.0, 1.0)])
"""Speech of every state of a phone lies elsewhere on a circle; what is seen is wider in the middle one."""


def sentences(count: int, lag: int, seed: int) -> list[AlignedUtterance]:
    """Sentences of ten phones; a state lasts 3 to 7 frames; what is seen is ``lag`` frames ahead of the speech."""
    made = []
    for number in range(count):
        draw = np.random.default_rng([seed, number])
        phones = draw.integers(1, 3, 10).cumsum() % 3  # none twice in a row
        frames = draw.integers(3, 8, (10, STATES))
        edges = (np.cumsum([0, *frames.sum(axis=1)]) / 100).tolist()
        spans = (Span(a, b, Unit(PHONES[p])) for (a, b), p in zip(pairwise(edges), phones, strict=True))
        state = np.repeat(STATES * np.repeat(phones, STATES) + np.tile(np.arange(STATES), 10), frames.ravel())
        early = state[np.clip(np.arange(len(state)) + lag, 0, len(state) - 1)]
        lips = SEEN[early // STATES] * np.where(early % STATES == 1, 1.3, 1)[:, None]
        speech = 3 * np.stack([np.cos(state * 2 * np.pi / 9), np.sin(state * 2 * np.pi / 9)], axis=1)
        noisy = (values + draw.normal(0, size, values.shape) for values, size in ((speech, 0.6), (lips, 0.3)))
        streams = tuple(values.astype(np.float32) for values in noisy)
        made.append(AlignedUtterance(densities.AudioVisualObservations(streams, (None, None)), Timeline(tuple(spans))))
    return made


@cache
def trained(lag: int, kind: str, limit: int | None = 1, **more: object) -> tuple[model.Chains, float]:
    """Return chains, and the correlation of the lips that they make from speech alone, as the paper converts."""
    of = Structure(kind, (THREE,) if kind == MULTISTREAM else (THREE, THREE), STATES, limit, **more)
    *_, grown = growing_chains(of, ("speech", "seen"), sentences(20, lag, 0), MixtureSchedule((1, 1), (1.0, 1.0)))
    how, held_out, full = ConversionSettings(VITERBI, EXACT, 5), sentences(8, lag, 1), grown.model.full_lattice
    lips = [convert(grown.model, one.observations, full, how).streams[1] for one in held_out]
    recorded = [one.observations.streams[1].astype(float) for one in held_out]
    return grown.model, float(pooled_correlation(lips, recorded).mean())


def lead_shares(chains: model.Chains, lag: int) -> np.ndarray:
    """Return the shares of frames in which the lips are a state behind, in step and a state ahead, by both streams."""
    shares = np.zeros(3)
    for one in sentences(20, lag, 0):
        joint = chains.infer(one.observations, lattice_utterance(chains, one).lattice).posteriors.joint
        shares += np.bincount(chains.transitions.product.lead[1][joint.states] + 1, joint.probability.sum(axis=0), 3)
    return shares / shares.sum()


@pytest.mark.parametrize("lag", [5, -5])
@pytest.mark.parametrize("more", [{}, {"moves_together": True}])
def test_with_a_lag_coupled_chains_win(lag, more):
    """The lips are a state ahead of the voice, or behind it: one chain cannot say so."""
    chains, acc = trained(lag, COUPLED, **more)
    assert acc > trained(lag, MULTISTREAM)[1] + 0.05
    behind, _, ahead = lead_shares(chains, lag)
    assert (ahead > behind) == (lag > 0)
    assert max(ahead, behind) > 0.2


def test_without_a_lag_chains_that_move_together_are_one_chain():
    """By Eq. 2 both move by chance, given the joint state before: a tenth of the frames is out of step for nothing."""
    alone, together, printed = trained(0, MULTISTREAM), trained(0, COUPLED, moves_together=True), trained(0, COUPLED)
    assert together[1] == pytest.approx(alone[1], abs=0.005)
    assert lead_shares(together[0], 0)[1] > 0.99
    assert lead_shares(printed[0], 0)[1] < 0.9
    assert printed[1] < alone[1] - 0.005


def test_factorial_chains_as_printed_may_be_apart_from_the_start():
    """Without a limit in Viterbi training, more joint states two states apart have densities of their own."""
    two_apart = []
    for start_limit in (1, 2):
        chains, _ = trained(8, FACTORIAL, None, start_limit=start_limit, unseen_loss=0.0)
        first, second = chains.transitions.own_density_states.T
        two_apart.append(np.count_nonzero((first // STATES == second // STATES) & (np.abs(first - second) == 2)))
    assert two_apart[1] > two_apart[0]
