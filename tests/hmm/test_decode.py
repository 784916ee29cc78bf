from itertools import pairwise

import numpy as np
import pytest

from hmm.synthetic import SILENCE, UNITS, known_hmm, random_hmm, sentences, speaker, within_silence
from lipmotion.hmm.model import HmmConfig
from lipmotion.hmm.network import build_unit_loop, compute_log_likelihoods, decode_units
from oracles import sequences

INVENTORY = (SILENCE, "a", "b")


def decoded(hmm, features, inventory=INVENTORY):
    units, bounds = decode_units(build_unit_loop(hmm, inventory), compute_log_likelihoods(hmm, features))
    return units, bounds.tolist()


def own_score(hmm, features, units, bounds) -> float:
    """Return the best score of units with the bounds that were recognised."""
    cuts = (
        durations
        for durations in sequences.segmentations(len(features), sum(hmm.table.count(unit) for unit in units))
        if sequences.boundaries(hmm, units, durations) == bounds
    )
    return max(sequences.score(hmm, features, units, durations) for durations in cuts)


@pytest.mark.parametrize(("states", "frames"), [(1, 5), (2, 6), (3, 7), (5, 10)])
@pytest.mark.parametrize(("contexts", "seed"), [(0, 0), (6, 1), (6, 2)])
def test_no_sequence_of_units_is_better(seed, contexts, states, frames):
    """The bigram of every unit counts exactly once, in any context."""
    hmm = random_hmm(seed, states=states, contexts=contexts)
    features = np.random.default_rng([seed, frames]).normal(0, 1.5, (frames, 2)).astype(np.float32)
    candidates = [  # of one state, a unit after itself is the same path as one that lasts longer
        units
        for units in sequences.sequences(INVENTORY, dict.fromkeys(INVENTORY, states), frames)
        if states > 1 or all(unit != following for unit, following in pairwise(units))
    ]
    units, bounds = decoded(hmm, features)
    best = sequences.best(hmm, features, candidates)[2]
    assert own_score(hmm, features, units, bounds) == pytest.approx(best, abs=1e-3)


def test_a_known_sequence_is_recovered():
    who = speaker()
    for number, words in enumerate(sentences(1, 10)):
        features, edges = who.say(np.random.default_rng(number), within_silence(words))
        found, bounds = decoded(known_hmm(who), features, (SILENCE, *UNITS))
        assert found == within_silence(words)
        assert bounds == pytest.approx(edges, abs=1)


def test_silence_alone_is_silence_however_unlikely_it_is_to_follow_itself():
    who = speaker()
    hmm = known_hmm(who, list(map(within_silence, sentences(1, 40))), HmmConfig(mixtures=1, bigram_weight=20.0))
    features, edges = who.say(np.random.default_rng(1), (SILENCE,))
    assert decoded(hmm, features, (SILENCE, *UNITS)) == ((SILENCE,), edges)


def test_short_silence_at_the_start_is_not_priced_out():
    """Silence never follows silence, nor the silence before a recording that begins in silence."""
    who = speaker(spread=2.0)
    hmm = known_hmm(who, list(map(within_silence, sentences(1, 400))), HmmConfig(mixtures=1, bigram_weight=8.0))
    sounds = [who.means[SILENCE][:1], *(who.means[unit] for unit in ("b", "c", SILENCE))]
    features = np.repeat(np.concatenate(sounds), 3, axis=0).astype(np.float32)
    assert decoded(hmm, features, (SILENCE, *UNITS))[0] == (SILENCE, "b", "c", SILENCE)


def test_the_bigram_decides_between_units_that_sound_alike():
    who = speaker()
    who.means["e"] = who.means["d"]
    hmm = known_hmm(who, [(SILENCE, "a", "e", SILENCE)] * 9 + [(SILENCE, "b", "d", SILENCE)] * 9)
    for first, second in (("a", "e"), ("b", "d")):
        features, _ = who.say(np.random.default_rng(2), (SILENCE, first, second, SILENCE))
        assert decoded(hmm, features, (SILENCE, *UNITS))[0] == (SILENCE, first, second, SILENCE)


def test_a_price_on_units_leaves_fewer():
    features = np.random.default_rng(4).normal(0, 1.5, (60, 2)).astype(np.float32)
    cheap, dear = (random_hmm(4, config=HmmConfig(3, bigram_weight=1.0, insertion=price)) for price in (8.0, -8.0))
    assert len(decoded(dear, features)[0]) < len(decoded(cheap, features)[0])
