import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.kernels.forward_backward import LOG_ZERO, chain_posteriors, log_forward_backward
from oracles import paths


def padded(seed: int, sizes: list[tuple[int, int]], padding: float = 0.0):
    """Return random chains of given frames and states, padded for the kernel, and one by one for the oracle."""
    draw = np.random.default_rng(seed)
    T, S = (max(size[axis] for size in sizes) for axis in range(2))
    log_emission = np.full((T, len(sizes), S), padding)
    log_stay = np.full((len(sizes), S), -1.0)
    log_move = log_stay.copy()
    single = []
    for u, (frames, states) in enumerate(sizes):
        emission, keep = draw.normal(0, 3, (frames, states)), draw.uniform(0.05, 0.95, states)
        log_emission[:frames, u, :states] = emission
        log_stay[u, :states], log_move[u, :states] = np.log(keep), np.log1p(-keep)
        single.append((emission, np.log(keep), np.log1p(-keep)))
    frames, states = np.array(sizes, np.intp).T
    return (log_emission, log_stay, log_move, frames, states), single


def by_definition(log_emission, log_stay, log_move):
    """Return what ``chain_posteriors`` returns of one chain, from the definition for any network."""
    states = np.arange(len(log_stay))
    arcs = np.append(states, states[:-1]), np.append(states, states[1:]), np.append(log_stay, log_move[:-1])
    begin, end = np.full((2, len(states)), -np.inf)
    begin[0], end[-1] = 0, log_move[-1]
    log_posterior, counts, log_likelihood = log_forward_backward(begin, log_emission, *arcs, end)
    return np.exp(log_posterior), counts[: len(states)], log_likelihood


@given(seed=st.integers(0, 2**32 - 1), frames=st.integers(1, 6), spread=st.sampled_from([1.0, 30.0, 1e3]))
@settings(max_examples=25)
def test_the_definition_agrees_with_the_enumeration_of_all_paths(seed, frames, spread):
    draw = np.random.default_rng(seed)
    emission, ends = draw.normal(0, spread, (frames, 3)), np.log(draw.dirichlet(np.ones(3), 2))
    arcs = {(a, b): np.log(draw.uniform()) for a in range(3) for b in range(3) if draw.uniform() < 0.6}
    arrays = *np.array(list(arcs), np.intp).reshape(-1, 2).T, np.array(list(arcs.values()))
    log_posterior, counts, log_likelihood = log_forward_backward(ends[0], emission, *arrays, ends[1])
    wanted, wanted_counts, wanted_log_likelihood = paths.posteriors(emission, np.arange(3), arcs, *ends)
    assert np.exp(log_posterior) == pytest.approx(wanted, abs=1e-9)
    assert counts == pytest.approx(list(wanted_counts.values()), abs=1e-9)
    assert log_likelihood == pytest.approx(wanted_log_likelihood, abs=1e-9)


@given(seed=st.integers(0, 2**32 - 1), loudness=st.sampled_from([1.0, 1e3]))
@settings(max_examples=10)
def test_chains_are_those_of_the_definition(seed, loudness):
    sizes = [(60, 7), (31, 5), (7, 7), (3, 4)]
    (log_emission, *rest), single = padded(seed, sizes)
    posterior, stay, log_likelihood = chain_posteriors(log_emission * loudness, *rest)
    for u, ((frames, states), (emission, *moves)) in enumerate(zip(sizes, single, strict=True)):
        wanted_posterior, wanted_stay, wanted_log_likelihood = by_definition(emission * loudness, *moves)
        assert posterior[:frames, u, :states] == pytest.approx(wanted_posterior, abs=1e-8)
        assert stay[u, :states] == pytest.approx(wanted_stay, abs=1e-8)
        found = log_likelihood[u] if log_likelihood[u] > LOG_ZERO / 2 else -np.inf
        assert found == pytest.approx(wanted_log_likelihood, rel=1e-12)
