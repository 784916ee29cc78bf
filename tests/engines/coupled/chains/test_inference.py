import numpy as np
import pytest

from engines.coupled.tiny import KINDS, THREE, TWO, chains, observations, structure
from lipmotion.engines.coupled.chains.product import Transitions
from lipmotion.engines.coupled.chains.structures import COUPLED, FACTORIAL, HMM, MULTISTREAM
from lipmotion.engines.coupled.conversion.em_conversion import precision_statistics
from oracles import coupled as oracle

every = pytest.mark.parametrize(("kind", "sets", "limit"), KINDS)


def made(kind, sets, limit, **other):
    return chains(structure(kind, sets, limit=limit), **other)


@every
@pytest.mark.parametrize("seen", [True, False, 0.5])
def test_posteriors_are_those_of_all_paths(kind, sets, limit, seen):
    model, data = made(kind, sets, limit), observations(seen=seen)
    lattice = model.full_lattice
    result = model.posteriors(model.emission_log_densities(data, lattice), lattice)
    joint, counts, log_likelihood = oracle.posteriors(model, data)
    for chain, states in enumerate(model.transitions.product.chain_states):
        for state in range(model.structure.state_counts[chain]):
            np.testing.assert_allclose(result.chains[chain][:, state], joint[:, states == state].sum(axis=1), atol=2e-5)
    np.testing.assert_array_equal(result.most_probable, joint.argmax(axis=1))
    assert result.log_likelihood == pytest.approx(log_likelihood, rel=1e-5)
    product = model.transitions.product
    expected = [counts.get(pair, 0.0) for pair in zip(product.arc_from.tolist(), product.arc_to.tolist(), strict=True)]
    np.testing.assert_allclose(result.transition_counts, expected, atol=5e-5)
    for number, group in enumerate(model.groups):
        for density in range(group.mixtures.size[0]):
            np.testing.assert_allclose(
                result.densities[number][:, density], joint[:, group.tie == density].sum(axis=1), atol=2e-5
            )


@every
def test_the_best_path_is_the_best_of_all(kind, sets, limit):
    model, data = made(kind, sets, limit), observations()
    path, score = model.best_path(model.emission_log_densities(data, model.full_lattice), model.full_lattice)
    best, value = max(oracle.paths(model, data), key=lambda pair: pair[1])
    assert tuple(path) == best
    assert score == pytest.approx(value, rel=1e-4)


@every
def test_expected_precisions_and_means(kind, sets, limit):
    model, data = made(kind, sets, limit), observations()
    precision, weighted = precision_statistics(model, model.infer(data, model.full_lattice), 1)
    number = 0 if kind == HMM else 1
    expected = oracle.component_statistics(model, data, number, 1)
    np.testing.assert_allclose(precision, expected[0], rtol=1e-4)
    np.testing.assert_allclose(weighted, expected[1], rtol=1e-3, atol=1e-4)


def test_decoupled_tables_without_a_limit_are_the_product_of_hmms():
    """γ of each chain, and the likelihood, are those of the chains alone."""
    model = made(FACTORIAL, (THREE, TWO), None)
    product = model.transitions.product
    draw = np.random.default_rng(5)
    own = [draw.uniform(0.2, 0.8, count) for count in product.structure.state_counts]
    decoupled = Transitions(product, model.transitions.rows, tuple(own))
    coupled = type(model)(model.streams, decoupled, model.groups)
    data = observations(6)
    result = coupled.posteriors(coupled.emission_log_densities(data, coupled.full_lattice), coupled.full_lattice)
    total = 0.0
    for chain in range(2):
        posterior, log_likelihood = single_chain(coupled, chain, own[chain], data)
        total += log_likelihood
        np.testing.assert_allclose(result.densities[chain], posterior, atol=2e-5)
    assert result.log_likelihood == pytest.approx(total, rel=1e-5)


def single_chain(model, chain, advance, data):
    """Posteriors of one chain alone, by dense matrices."""
    structure, grammar = model.structure, model.transitions.product.grammar
    count, states = structure.state_counts[chain], structure.states
    matrix, initial = np.diag(1 - advance), np.zeros(count)
    initial[::states] = grammar.initial[chain] / grammar.initial[chain].sum()
    for state in range(count):
        if state % states < states - 1:
            matrix[state, state + 1] += advance[state]
        else:
            matrix[state, ::states] += advance[state] * grammar.bigrams[chain][state // states]
    group = model.groups[chain]
    density = np.exp([[oracle.log_density(group, g, data, t)[0] for g in range(count)] for t in range(data.frames)])
    alpha = [initial * density[0]]
    for row in density[1:]:
        alpha.append((alpha[-1] @ matrix) * row)
    beta = [np.ones(count)]
    for row in density[:0:-1]:
        beta.append(matrix @ (row * beta[-1]))
    joint = np.array(alpha) * np.array(beta[::-1])
    return joint / joint.sum(axis=1, keepdims=True), float(np.log(alpha[-1].sum()))


def test_a_factorial_hmm_of_one_chain_is_the_hmm():
    """With equal densities of all states of the second chain, the posteriors are those of the first chain alone."""
    model = made(FACTORIAL, (THREE, TWO), None)
    group = model.groups[1]
    same = group.mixtures.select(np.zeros(group.mixtures.size[0], np.intp))
    blind = type(model)(
        model.streams,
        model.transitions,
        (model.groups[0], type(group)(group.streams, group.columns, same, group.weights, group.tie)),
    )
    data = observations(6)
    result = blind.posteriors(blind.emission_log_densities(data, blind.full_lattice), blind.full_lattice)
    posterior, _ = single_chain(blind, 0, blind.transitions.advance[0], data)
    np.testing.assert_allclose(result.densities[0], posterior, atol=2e-5)


def test_one_gaussian_each_makes_hmm_and_multistream_hmm_the_same():
    joint, apart = made(HMM, (THREE,), 1, components=(1,)), made(MULTISTREAM, (THREE,), 1, components=(1, 1))
    whole = joint.groups[0].mixtures
    groups = []
    for group, columns in zip(apart.groups, (slice(0, 2), slice(2, 3)), strict=True):
        cut = type(whole)(whole.log_weights, whole.means[:, :, columns], whole.variances[:, :, columns])
        groups.append(type(group)(group.streams, group.columns, cut, group.weights, group.tie))
    apart = type(apart)(apart.streams, joint.transitions, tuple(groups))
    data = observations(6)
    one, other = (x.posteriors(x.emission_log_densities(data, x.full_lattice), x.full_lattice) for x in (joint, apart))
    np.testing.assert_allclose(one.chains[0], other.chains[0], atol=1e-6)
    assert one.log_likelihood == pytest.approx(other.log_likelihood, rel=1e-6)


def test_a_lattice_of_all_units_is_the_full_one_and_a_smaller_one_excludes_paths():
    model, data = made(COUPLED, (THREE, TWO), 1), observations(5)
    product = model.transitions.product
    allowed = np.ones((5, 3), bool)
    result = model.posteriors(model.emission_log_densities(data, model.full_lattice), model.full_lattice)
    free = model.lattice(allowed)
    same = model.posteriors(model.emission_log_densities(data, free), free)
    assert same.log_likelihood == pytest.approx(result.log_likelihood, rel=1e-6)
    allowed[:, 1] = False
    allowed[2:, 2] = False
    part = model.lattice(allowed)
    less = model.posteriors(model.emission_log_densities(data, part), part)
    paths = [
        (path, score)
        for path, score in oracle.paths(model, data)
        if all(allowed[t, product.joint_states[state].units[0]] for t, state in enumerate(path))
    ]
    assert less.log_likelihood == pytest.approx(np.logaddexp.reduce([score for _, score in paths]), rel=1e-5)
    np.testing.assert_allclose(less.chains[0].sum(axis=1), 1, atol=1e-5)
