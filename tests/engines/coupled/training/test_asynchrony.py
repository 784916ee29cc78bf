"""Streams with a known lag: chains that may be apart must be better than one, and no worse without a lag."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from engines.coupled.tiny import THREE
from lipmotion.engines.coupled.chains.densities import AudioVisualObservations
from lipmotion.engines.coupled.chains.lattice import FactorialTransitions
from lipmotion.engines.coupled.chains.model import Chains
from lipmotion.engines.coupled.chains.structures import COUPLED, FACTORIAL, MULTISTREAM, Structure
from lipmotion.engines.coupled.conversion.em_conversion import EXACT, VITERBI, ConversionSettings, convert
from lipmotion.engines.coupled.training.alignment import AlignedUtterance
from lipmotion.engines.coupled.training.chain_training import MixtureSchedule, growing_chains
from lipmotion.engines.coupled.training.em_steps import lattice_utterance
from lipmotion.measures.curves import pooled_correlation
from lipmotion.types import Span, Timeline, Unit

STATES = 3
PHONES = ("p", "uw", "aa")
SEEN = {"p": (0.0, 0.0), "uw": (0.5, -2.0), "aa": (2.0, 1.0)}
"""Speech of every state of a phone lies elsewhere on a circle; what is seen is wider in the middle one."""


def sentences(count: int, lag: int, seed: int) -> list[AlignedUtterance]:
    """Sentences of ten phones; a state lasts 3 to 7 frames; what is seen is ``lag`` frames ahead of the speech."""
    made = []
    for number in range(count):
        draw = np.random.default_rng([seed, number])
        phones = [PHONES[one % 3] for one in draw.integers(1, 3, 10).cumsum()]  # none twice in a row
        frames = draw.integers(3, 8, (len(phones), STATES))
        edges = np.cumsum([0, *frames.sum(axis=1)]) / 100
        spans = tuple(Span(a, b, Unit(p)) for (a, b), p in zip(pairwise(edges.tolist()), phones, strict=True))
        angle = [2 * np.pi * (PHONES.index(p) * STATES + s) / 9 for p in phones for s in range(STATES)]
        seen = [(1 + 0.3 * (s == 1)) * np.array(SEEN[p]) for p in phones for s in range(STATES)]
        speech = np.repeat(3 * np.stack([np.cos(angle), np.sin(angle)], axis=1), frames.ravel(), axis=0)
        lips = np.repeat(seen, frames.ravel(), axis=0)[np.clip(np.arange(len(speech)) + lag, 0, len(speech) - 1)]
        streams = (speech + draw.normal(0, 0.6, speech.shape), lips + draw.normal(0, 0.3, lips.shape))
        found = tuple(stream.astype(np.float32) for stream in streams)
        made.append(AlignedUtterance(AudioVisualObservations(found, (None, None)), Timeline(spans)))
    return made


@cache
def trained(lag: int, kind: str, limit: int | None = 1, **more: object) -> tuple[Chains, float]:
    """Return chains, and the correlation of the lips that they make from speech alone, as the paper converts."""
    structure = Structure(kind, (THREE,) if kind == MULTISTREAM else (THREE, THREE), STATES, limit, **more)
    *_, grown = growing_chains(
        structure, ("speech", "seen"), sentences(20, lag, 0), MixtureSchedule((1, 1), (1.0, 1.0))
    )
    chains, pairs = grown.model, []
    for one in sentences(8, lag, 1):
        how = ConversionSettings(VITERBI, EXACT, 5)
        made = convert(chains, one.observations, chains.full_lattice, how).streams[1]
        pairs.append((made, one.observations.streams[1].astype(float)))
    return chains, float(pooled_correlation(*zip(*pairs, strict=True)).mean())


def lead_shares(chains: Chains, lag: int) -> np.ndarray:
    """Return the shares of frames in which the lips are a state behind, in step and a state ahead, by both streams."""
    shares = np.zeros(3)
    for one in sentences(20, lag, 0):
        joint = chains.infer(one.observations, lattice_utterance(chains, one).lattice).posteriors.joint
        assert joint is not None
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
    alone, coupled = trained(0, MULTISTREAM), trained(0, COUPLED, moves_together=True)
    assert coupled[1] == pytest.approx(alone[1], abs=0.005)
    assert lead_shares(coupled[0], 0)[1] > 0.99


def test_by_equation_2_chains_cannot_stay_in_step():
    """Both move by chance only, given the joint state before: without any lag a tenth of the frames is out of step."""
    chains, acc = trained(0, COUPLED)
    assert lead_shares(chains, 0)[1] < 0.9
    assert acc < trained(0, MULTISTREAM)[1] - 0.005


def test_factorial_chains_as_printed_may_be_apart_from_the_start():
    """Without a limit in Viterbi training, more joint states two states apart have densities of their own."""
    two_apart = []
    for start_limit in (1, 2):
        chains, _ = trained(8, FACTORIAL, None, start_limit=start_limit, unseen_loss=0.0)
        assert isinstance(chains.transitions, FactorialTransitions)
        first, second = chains.transitions.own_density_states.T
        within = first // STATES == second // STATES
        two_apart.append(np.count_nonzero(np.abs(first - second)[within] == 2))
    assert two_apart[1] > two_apart[0]
