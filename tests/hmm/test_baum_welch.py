from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmm.synthetic import known_hmm, random_hmm, recordings, speaker
from lipmotion.hmm import align, model, network, unit_training
from lipmotion.hmm.unit_training import accumulate_statistics, adapt_contexts, reestimate_states
from lipmotion.stats.em import run_em
from oracles import paths


def step(hmm, data, said):
    """Return the models after one step of Baum–Welch, and the mean log likelihood per frame before it."""
    result = run_em(hmm, lambda model: accumulate_statistics(model, data, said), reestimate_states, 1)
    return result.model, result.log_likelihoods[0]


def disturbed(seed: int, spread: float):
    """Return a speaker's data, models with disturbed parameters, and the units of every utterance."""
    who, draw = speaker(seed, spread), np.random.default_rng(seed)
    transcribed, said, _ = recordings(seed, 15, who, pauses=True)
    hmm = known_hmm(who)
    means = hmm.mixtures.means + draw.normal(0, 1.5, hmm.mixtures.means.shape)
    mixtures = replace(hmm.mixtures, means=means.astype(np.float32), variances=np.full(means.shape, 4.0, np.float32))
    return replace(hmm, mixtures=mixtures), [utterance.features for utterance in transcribed], said


@pytest.mark.parametrize(("seed", "spread", "floor_share"), [(0, 0.4, None), (1, 2.0, None), (4, 0.4, 0.15)])
def test_no_iteration_lowers_the_likelihood(seed, spread, floor_share):
    """The tolerance, per frame, is for single precision and for posteriors that are left out."""
    hmm, data, said = disturbed(seed, spread)
    floor = (floor_share or 0) * np.concatenate(data).var(axis=0)
    if floor_share:
        hmm = replace(hmm, config=replace(hmm.config, variance_floor=floor_share))
        hmm = replace(hmm, mixtures=replace(hmm.mixtures, variances=np.maximum(hmm.mixtures.variances, floor)))
    for steps in (8,) if floor_share else (5, 5, 5):  # 1, 2 and 4 Gaussians
        figures = []
        for _ in range(steps):
            hmm, log_likelihood = step(hmm, data, said)
            figures.append(log_likelihood)
        assert all(after > before - 1e-5 for before, after in pairwise(figures))
        assert figures[-1] > figures[0] + 0.01
        assert np.isfinite(hmm.mixtures.log_weights).all()  # none was switched off: these were true steps of EM
        assert (hmm.mixtures.variances[:, 0] >= floor * 0.999).all()
        assert not floor_share or (hmm.mixtures.variances[:, 0] < floor * 1.001).any()
        hmm = replace(hmm, mixtures=hmm.mixtures.split())


def test_the_e_step_agrees_with_the_enumeration_of_all_paths():
    hmm, draw = random_hmm(1, contexts=6), np.random.default_rng(1)
    said = [("a",), ("sil", "b"), ("a", "sp"), ("b", "a")]
    data = [draw.normal(0, 1.5, (frames, 2)).astype(np.float32) for frames in (7, 8, 5, 7)]
    occupied, stays, total = np.zeros(len(hmm.table.names)), np.zeros(len(hmm.log_stay)), 0.0
    visits = stays.copy()
    for x, units in zip(data, said, strict=True):
        chain = align.expand_states(hmm, units)
        stay = hmm.log_stay[chain.plain].astype(float)
        emission = hmm.mixtures.log_likelihood(x)[:, chain.densities].astype(float)
        posterior, stay, log_likelihood = paths.chain_posteriors(emission, stay, np.log(-np.expm1(stay)))
        np.add.at(occupied, chain.densities, posterior.sum(axis=0))
        np.add.at(visits, chain.plain, posterior.sum(axis=0))
        np.add.at(stays, chain.plain, stay)
        total += log_likelihood
    statistics = accumulate_statistics(hmm, data, said)
    assert statistics.frames_of_densities == pytest.approx(occupied, abs=len(data) * 4 * unit_training.MIN_POSTERIOR)
    assert statistics.mean_log_likelihood == pytest.approx(total / sum(map(len, data)), abs=1e-4)
    keep = np.exp(reestimate_states(hmm, statistics).log_stay[visits > 0])
    assert keep == pytest.approx(np.clip(stays[visits > 0] / visits[visits > 0], 0.05, 11 / 12), abs=1e-4)


@given(sizes=st.lists(st.tuples(st.integers(1, 3000), st.integers(1, 600)), min_size=1, max_size=20))
def test_long_utterances_do_not_fill_the_memory(sizes):
    frames, states = zip(*sizes, strict=True)
    batches = list(unit_training.group_by_length(frames, states))
    assert sorted(i for batch in batches for i in batch) == list(range(len(sizes)))
    for batch in batches:
        padded = len(batch) * max(frames[i] for i in batch) * max(states[i] for i in batch)
        assert len(batch) == 1 or padded <= unit_training.CELLS


def test_no_state_may_last_longer_than_its_limit():
    """Otherwise the closure of a stop absorbs the silence before it."""
    who = speaker(1)
    data = [np.repeat(who.say(np.random.default_rng(n), ("sil", "a", "sil"))[0], 12, axis=0) for n in range(3)]
    hmm = known_hmm(who)
    better, _ = step(hmm, data, [("sil", "a", "sil")] * 3)
    lasting = {name: 1 / -np.expm1(float(stay)) for name, stay in zip(hmm.table.names, better.log_stay, strict=True)}
    longest = [lasting[f"a.{state}"] for state in range(3)]
    assert longest == pytest.approx([unit_training.LONGEST_STATE_FRAMES] * 3, rel=1e-4)
    assert unit_training.LONGEST_STATE_FRAMES < lasting["sil.0"] < unit_training.LONGEST_SILENCE_FRAMES


def coarticulated(count: int):
    """Return models, utterances in which the start of ``a`` depends on the unit before it, and their units."""
    who = speaker(1)
    hmm, (transcribed, said, _) = known_hmm(who), recordings(1, count, who)
    for utterance, units in zip(transcribed, said, strict=True):
        path = align.expand_states(hmm, units)
        nearest = align.align_states(hmm, network.compute_log_likelihoods(hmm, utterance.features), units)[1]
        for position, (before, unit) in enumerate(pairwise(units), start=1):
            if (before, unit) == ("d", "a"):
                utterance.features[(path.positions[nearest] == position) & (nearest % 3 == 0)] += [0, 0, 1.5, 0]
    return hmm, [utterance.features for utterance in transcribed], said


def test_contexts_get_densities_where_there_are_frames_enough():
    hmm, data, said = coarticulated(30)
    hmm = replace(hmm, config=model.HmmConfig(mixtures=1, context_frames=40, relevance=5.0))

    def in_context(context_frames):
        given = replace(hmm, config=replace(hmm.config, context_frames=context_frames))
        start = unit_training.add_contexts(given, data, said)
        result = run_em(
            start, lambda each: accumulate_statistics(each, data, said), adapt_contexts, given.config.iterations
        )
        return result.model, result.log_likelihoods

    better, log = in_context(40)
    plain = len(hmm.table.names)
    assert better.table.names[:plain] == hmm.table.names
    assert np.array_equal(better.mixtures.means[:plain], hmm.mixtures.means)  # those without context are kept
    assert "a.0<d" in better.table.names
    shift = better.mixtures.means[better.table.density("a", 0, "d")] - hmm.mixtures.means[hmm.table.density("a", 0)]
    assert shift[0] == pytest.approx([0, 0, 1.5, 0], abs=0.35)
    assert log[-1] > log[0]
    assert set(in_context(150)[0].table.names) < set(better.table.names)
    none, _ = in_context(10**6)
    assert none.table == hmm.table
    assert np.array_equal(none.mixtures.means, hmm.mixtures.means)
