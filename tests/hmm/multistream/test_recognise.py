from functools import cache

import numpy as np
import pytest

from hmm.multistream.synthetic import observed, random_joint, utterances
from kernels.networks import network_posteriors
from lipmotion.errors import AlignmentError, InputError
from lipmotion.hmm.model import HmmConfig, StateTable, UnitHmm
from lipmotion.hmm.multistream.densities import SPEECH, ObservedStream, StreamObservations, StreamWeights
from lipmotion.hmm.multistream.recognise import JointRecogniser, build_context_loop
from lipmotion.hmm.multistream.unit_states import expand_triphones
from lipmotion.hmm.network import build_unit_loop, compute_log_likelihoods, decode_units
from oracles import joint as slow
from oracles.sequences import sequences

WEIGHTS = StreamWeights(0.8, 0.5, 1.0, 0.3, 0.0)
SOFT = StreamWeights(0.1, 0.1, 0.05, 0, 0)
"""Small weights: no unit is certain."""


def slow_densities(hmm, data, weights):
    @cache
    def density(state, frame):
        return slow.log_density(hmm, data, state, frame, weights)

    return density


def state_posteriors(recogniser, data):
    """Return the posterior of every state without context in every frame [shape=(T, R)]."""
    loop = build_context_loop(recogniser.hmm)
    log_density = recogniser._log_likelihoods(data).log_density(0, data.frames, None)
    posteriors, _, _ = network_posteriors(log_density, *loop.network.network)
    result = np.zeros((data.frames, len(recogniser.hmm.inventory.monophones)))
    np.add.at(result.T, loop.monophones, posteriors.T.astype(float))
    return result


def candidates(hmm, frames):
    counts = {unit: hmm.inventory.count(unit) for unit in hmm.inventory.names}
    return sequences([unit for unit in hmm.inventory.names if unit != "sp"], counts, frames)


@pytest.mark.parametrize("both", [False, True])
@pytest.mark.parametrize(("seed", "states", "frames"), [(0, 2, 7), (1, 3, 8)])
def test_nothing_else_is_more_probable(seed, states, frames, both):
    hmm = random_joint(seed, states=states, components=1 + seed % 2, both_neighbours=both)
    data = observed(np.random.default_rng([seed, 1]), frames)
    density = slow_densities(hmm, data, WEIGHTS)
    best, units, lengths = max(slow.everything(hmm, density, frames, candidates(hmm, frames)))
    said = JointRecogniser(hmm, WEIGHTS).recognise(data)
    edges = [s.first for s in said] + [frames]
    assert tuple(s.unit for s in said) == units
    inside = iter(lengths)
    assert np.diff(edges).tolist() == [sum(next(inside) for _ in range(hmm.inventory.count(u))) for u in units]
    assert np.isfinite(best)


@pytest.fixture(scope="module")
def uncertain():
    """A recogniser, seven frames, and the share of every sequence of units with its durations."""
    hmm, data = random_joint(3, states=2, bigram_weight=0.3, insertion=1.5), observed(np.random.default_rng(4), 7)
    ways = list(slow.everything(hmm, slow_densities(hmm, data, SOFT), 7, candidates(hmm, 7)))
    scores = np.array([score for score, _, _ in ways])
    shares = np.exp(scores - np.logaddexp.reduce(scores))
    return JointRecogniser(hmm, SOFT), data, [(*way[1:], share) for way, share in zip(ways, shares, strict=True)]


def test_posteriors_are_the_shares_of_all_sequences(uncertain):
    recogniser, data, ways = uncertain
    known = recogniser.hmm.inventory
    expected = np.zeros((7, len(known.monophones)))
    for units, lengths, share in ways:
        expected[np.arange(7), np.repeat(expand_triphones(known, units).monophones, lengths)] += share
    found = state_posteriors(recogniser, data)
    assert found == pytest.approx(expected, abs=1e-4)
    assert found.sum(axis=1) == pytest.approx(np.ones(7), abs=1e-5)


def test_speech_alone_is_the_plain_model():
    """The densities of all contexts, by name, in plain unit models."""
    hmm = random_joint(8, streams=(SPEECH,))
    known, model = hmm.inventory, hmm.models[SPEECH]
    contexts = {f"{unit}.{state}": (("sil", unit, "sil"), state) for unit, state in known.monophones}
    for unit, state in known.monophones:
        side = known.side(unit, state)
        for other in ("sil", "a", "b") if side else ():
            context = (other, unit, "sil") if side < 0 else ("sil", unit, other)
            contexts[f"{unit}.{state}{'<' if side < 0 else '>'}{other}"] = (context, state)
    leaves = np.array([model.forest.leaf(each) for each in contexts.values()])
    table = StateTable(known.names, tuple(map(known.count, known.names)), tuple(contexts), known.free)
    config = HmmConfig(bigram_weight=hmm.config.bigram_weight, insertion=hmm.config.insertion)
    plain = UnitHmm(config, table, model.tied.mixtures.select(leaves), hmm.log_stay, hmm.bigram)
    data = observed(np.random.default_rng(9), 60, (SPEECH,))
    values = model.tied.values(model.scale.standardise(data.streams[SPEECH]))
    units, bounds = decode_units(build_unit_loop(plain, ["sil", "a", "b"]), compute_log_likelihoods(plain, values))
    said = JointRecogniser(hmm).recognise(data)
    assert tuple(s.unit for s in said) == units
    assert [s.first for s in said] == bounds[:-1].tolist()


def test_what_cannot_be_recognised():
    hmm, data = random_joint(12), utterances(1)[0].observed
    with pytest.raises(InputError, match="motion the weight 0"):
        JointRecogniser(hmm, StreamWeights())
    with pytest.raises(InputError, match="switched on are"):
        JointRecogniser(hmm, StreamWeights(0, 0, 0, 0, 0)).recognise(data)
    with pytest.raises(AlignmentError):
        JointRecogniser(hmm).recognise(observed(np.random.default_rng(0), 2))
    wide = StreamObservations({SPEECH: ObservedStream(np.zeros((9, 4)), np.ones(9, bool))})
    with pytest.raises(InputError, match="has 4 dimensions"):
        JointRecogniser(hmm).recognise(wide)
