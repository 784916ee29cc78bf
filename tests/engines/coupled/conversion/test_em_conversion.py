import numpy as np
import pytest

from engines.coupled.tiny import THREE, TWO, chains, observations, structure
from lipmotion.engines.coupled.chains.structures import COUPLED, FACTORIAL, HMM, MULTISTREAM
from lipmotion.engines.coupled.conversion.em_conversion import (
    EXACT,
    PRINTED,
    SOFT,
    VITERBI,
    ConversionSettings,
    convert,
    path_means,
    without_visual_streams,
)
from oracles import coupled as oracle

KINDS = [
    (COUPLED, (THREE, TWO), 1),
    (FACTORIAL, (THREE, TWO), 1),
    (FACTORIAL, (THREE, TWO), None),
    (MULTISTREAM, (THREE,), 1),
    (HMM, (THREE,), 1),
]
every = pytest.mark.parametrize(("kind", "sets", "limit"), KINDS)


@every
@pytest.mark.parametrize("start", [SOFT, VITERBI])
def test_speech_and_streams_become_more_likely_at_every_step(kind, sets, limit, start):
    for seed in range(2):
        model = chains(structure(kind, sets, limit=limit), seed=seed)
        result = convert(model, observations(12, seed=seed), model.full_lattice, ConversionSettings(start, EXACT, 15))
        assert len(result.log_likelihood) > 2
        assert min(np.diff(result.log_likelihood)) > -2e-6


def test_the_soft_start_is_the_precision_weighted_mean_over_all_paths():
    model, data = chains(), observations(4)
    result = convert(model, data, model.full_lattice, ConversionSettings(SOFT, EXACT, 0))
    precision, weighted = oracle.component_statistics(model, without_visual_streams(data), 1, 1)
    np.testing.assert_allclose(result.streams[1], weighted / precision, rtol=1e-3, atol=1e-4)


def test_values_of_visual_streams_are_ignored():
    model = chains()
    one, other = observations(6, seed=1), observations(6, seed=2)
    other = other.with_stream(0, one.streams[0])
    results = [
        convert(model, data, model.full_lattice, ConversionSettings(most_steps=4)).streams[1] for data in (one, other)
    ]
    np.testing.assert_array_equal(*results)


def test_the_viterbi_start_is_the_means_along_the_best_path():
    model, data = chains(), observations(5)
    result = convert(model, data, model.full_lattice, ConversionSettings(VITERBI, EXACT, 0))
    path, _ = max(oracle.paths(model, without_visual_streams(data)), key=lambda pair: pair[1])
    group = model.groups[1]
    expected = [
        (np.exp(group.mixtures.log_weights[d])[:, None] * group.mixtures.means[d]).sum(axis=0)
        for d in group.tie[list(path)]
    ]
    np.testing.assert_allclose(result.streams[1], expected, rtol=1e-5)
    np.testing.assert_allclose(path_means(model, np.array(path), 1), expected, rtol=1e-5)


def test_the_maximiser_is_where_the_derivative_vanishes():
    """Σ γ(q, k) Σ⁻¹ (μ − o) = 0: the joint likelihood itself is stationary where EM stands still."""
    model, data = chains(seed=3), observations(4, seed=3)
    result = convert(model, data, model.full_lattice, ConversionSettings(SOFT, EXACT, 400))

    def log_likelihood(values):
        return oracle.posteriors(model, data.with_stream(1, values.astype(np.float32)))[2]

    settled = result.streams[1]
    for frame in range(4):
        for step in (-0.02, 0.02):
            moved = settled.copy()
            moved[frame] += step
            assert log_likelihood(moved) <= log_likelihood(settled) + 1e-4


def test_the_printed_update_weighs_by_components_and_partners():
    """Eq. 9: every joint state counts, so a visual state counts as often as it has partners, and w stands twice."""
    model, data = chains(), observations(4)
    start = convert(model, data, model.full_lattice, ConversionSettings(SOFT, EXACT, 0)).streams[1]
    printed = convert(model, data, model.full_lattice, ConversionSettings(SOFT, PRINTED, 1)).streams[1]
    seen = data.with_stream(1, start.astype(np.float32))
    joint, _, _ = oracle.posteriors(model, seen)
    group = model.groups[1]
    expected = np.zeros_like(printed)
    for frame in range(4):
        top, bottom = 0.0, 0.0
        for state in range(joint.shape[1]):  # the sum over q_t of Eq. 9
            density = group.tie[state]
            visual = joint[frame, group.tie == density].sum()  # γ_t(q^v, k) without its share
            total, terms = oracle.log_density(group, density, seen, frame)
            for component, term in enumerate(terms):
                weight = visual * np.exp(term - total) * np.exp(group.mixtures.log_weights[density, component])
                inverse = 1 / group.mixtures.variances[density, component]
                top, bottom = (
                    top + weight * inverse * group.mixtures.means[density, component],
                    bottom + weight * inverse,
                )
        expected[frame] = top / bottom
    np.testing.assert_allclose(printed, expected, rtol=1e-3, atol=1e-4)


def test_with_one_component_and_one_partner_each_print_and_maximiser_agree():
    model = chains(structure(MULTISTREAM, (THREE,)), components=(1, 1))
    data = observations(6)
    one, other = (
        convert(model, data, model.full_lattice, ConversionSettings(SOFT, update, 5)) for update in (EXACT, PRINTED)
    )
    np.testing.assert_allclose(one.streams[1], other.streams[1], rtol=1e-4, atol=1e-5)
