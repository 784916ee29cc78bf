import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kernels.networks import network_posteriors, phone_loop, random_network
from lipmotion.kernels.arcs import lay_out_arcs
from lipmotion.kernels.forward_backward import log_forward_backward
from lipmotion.kernels.network import ForwardBackwardNetwork
from oracles import paths

SEEDS = st.integers(0, 2**32 - 1)


def random_emission(seed: int, frames: int, densities: int, spread: float = 4.0) -> np.ndarray:
    return np.random.default_rng([seed, 1]).normal(-20, spread, (frames, densities))


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_posteriors_of_every_frame_sum_to_one_and_followed_arcs_are_as_many_as_steps(precision):
    arrays, _ = phone_loop(5)
    log_emission = random_emission(5, 200, len(arrays["emission"]), 30.0).astype(precision)
    posterior, counts, _ = network_posteriors(log_emission, **arrays)
    tolerance = 1e-9 if precision is np.float64 else 1e-5
    assert posterior.sum(axis=1) == pytest.approx(np.ones(200), abs=tolerance)
    assert counts.sum() == pytest.approx(199, abs=199 * tolerance)
    arrived = np.add.reduceat(counts, arrays["arc_start"])
    assert arrived == pytest.approx(posterior[1:].sum(axis=0), abs=199 * tolerance)


@given(seed=SEEDS, frames=st.integers(1, 6), spread=st.sampled_from([1.0, 30.0, 1e3]))
@settings(max_examples=25)
def test_the_definition_agrees_with_the_enumeration_of_all_paths(seed, frames, spread):
    draw = np.random.default_rng(seed)
    emission, ends = draw.normal(0, spread, (frames, 3)), np.log(draw.dirichlet(np.ones(3), 2))
    arcs = {(a, b): np.log(draw.uniform()) for a in range(3) for b in range(3) if draw.uniform() < 0.6}
    arrays = *np.array(list(arcs), np.intp).reshape(-1, 2).T.copy(), np.array(list(arcs.values()))
    log_posterior, counts, log_likelihood = log_forward_backward(ends[0], emission, *arrays, ends[1])
    wanted, wanted_counts, wanted_log_likelihood = paths.posteriors(emission, np.arange(3), arcs, *ends)
    assert np.exp(log_posterior) == pytest.approx(wanted, abs=1e-9)
    assert counts == pytest.approx(list(wanted_counts.values()), abs=1e-9)
    assert log_likelihood == pytest.approx(wanted_log_likelihood, abs=1e-9)


def test_no_path_says_so():
    network, starts, factors, columns = chained(8, 5, 1.0)  # chains that allow nothing together
    for factor in factors:
        factor[2] = -np.inf
    found = network.posteriors(*starts, factors, columns)
    assert found.log_likelihood == -np.inf
    assert not found.posterior.any()
    assert not found.counts.any()


def chained(seed: int, frames: int, spread: float, chains: int = 2):
    """Return a loop of phones whose densities are products: network, probabilities, factors, column of each place."""
    arrays, _ = phone_loop(seed)
    network, draw = ForwardBackwardNetwork.of(arrays["arc_from"], arrays["arc_start"]), np.random.default_rng([seed, 2])
    factors = [draw.normal(-20, spread, (frames, 4 + chain)) for chain in range(chains)]
    columns = [draw.integers(4 + chain, size=len(arrays["emission"])) for chain in range(chains)]
    return network, (arrays["arc_log"], arrays["log_initial"]), factors, columns


def arcs_in(layout):
    """Return every arc of a layout as (arc, source, target), with the states' own numbers."""
    order = layout.order
    for target, source, length, first in layout.runs:
        for i in range(length):
            yield layout.run_arcs[first + i], order[source + i], order[target + i]
    for target, targets, first, sources in layout.blocks:
        for s in range(first, first + sources):
            for t in range(targets):
                yield layout.block_arcs[s, t], order[layout.block_sources[s]], order[target + t]


def all_are_there(arrays) -> None:
    layout = lay_out_arcs(arrays["arc_from"], arrays["arc_start"])
    counts = np.diff(arrays["arc_start"], append=len(arrays["arc_from"]))
    targets = np.repeat(np.arange(len(counts)), counts)
    assert sorted(arcs_in(layout)) == list(zip(range(len(targets)), arrays["arc_from"], targets, strict=True))
    assert np.array_equal(layout.place[layout.order], np.arange(len(counts)))


@given(seed=st.integers(0, 2**32 - 1), states=st.integers(1, 30), dense=st.sampled_from([0.05, 0.5, 1.0]))
@settings(max_examples=30)
def test_every_arc_has_its_place(seed, states, dense):
    all_are_there(random_network(seed, states, 3, dense)[0])


def test_a_loop_of_phones_is_one_block_and_few_runs():
    for units, states in ((11, 3), (9, 1), (4, 2)):
        all_are_there(phone_loop(1, units, states)[0])
    arrays, _ = phone_loop(1, units=21, states=5)
    layout = lay_out_arcs(arrays["arc_from"], arrays["arc_start"])
    assert [tuple(block[[1, 3]]) for block in layout.blocks] == [(20, 21)]
    assert len(layout.runs) == 5
