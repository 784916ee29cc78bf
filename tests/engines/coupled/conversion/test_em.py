import numpy as np
import pytest

from engines.coupled.tiny import THREE, TWO, chains, observed, structure
from lipmotion.engines.coupled.chains.structures import COUPLED, FACTORIAL, HMM, MULTISTREAM
from lipmotion.engines.coupled.conversion.em import (
    EXACT,
    PRINTED,
    SOFT,
    VITERBI,
    Conversion,
    converted,
    path_means,
    speech_alone,
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
    for seed in range(6):
        found = chains(structure(kind, sets, limit=limit), seed=seed)
        result = converted(found, observed(12, seed=seed), found.everywhere, Conversion(start, EXACT, 15))
        assert len(result.log_likelihood) > 2
        assert min(np.diff(result.log_likelihood)) > -2e-6


def test_the_soft_start_is_the_precision_weighted_mean_over_all_paths():
    found, data = chains(), observed(4)
    result = converted(found, data, found.everywhere, Conversion(SOFT, EXACT, 0))
    precision, weighted = oracle.component_statistics(found, speech_alone(data), 1, 1)
    np.testing.assert_allclose(result.streams[1], weighted / precision, rtol=1e-3, atol=1e-4)


def test_what_is_seen_says_nothing():
    found = chains()
    one, other = observed(6, seed=1), observed(6, seed=2)
    other = other.given(0, one.streams[0])
    results = [converted(found, data, found.everywhere, Conversion(most=4)).streams[1] for data in (one, other)]
    np.testing.assert_array_equal(*results)


def test_the_viterbi_start_is_the_means_along_the_best_path():
    found, data = chains(), observed(5)
    result = converted(found, data, found.everywhere, Conversion(VITERBI, EXACT, 0))
    path, _ = max(oracle.paths(found, speech_alone(data)), key=lambda pair: pair[1])
    group = found.groups[1]
    expected = [
        (np.exp(group.mixtures.log_weights[d])[:, None] * group.mixtures.means[d]).sum(axis=0)
        for d in group.tie[list(path)]
    ]
    np.testing.assert_allclose(result.streams[1], expected, rtol=1e-5)
    np.testing.assert_allclose(path_means(found, np.array(path), 1), expected, rtol=1e-5)


def test_the_maximiser_is_where_the_derivative_vanishes():
    """Σ γ(q, k) Σ⁻¹ (μ − o) = 0: the joint likelihood itself is stationary where EM stands still."""
    found, data = chains(seed=3), observed(4, seed=3)
    result = converted(found, data, found.everywhere, Conversion(SOFT, EXACT, 400))

    def log_likelihood(values):
        return oracle.posteriors(found, data.given(1, values.astype(np.float32)))[2]

    settled = result.streams[1]
    for frame in range(4):
        for step in (-0.02, 0.02):
            moved = settled.copy()
            moved[frame] += step
            assert log_likelihood(moved) <= log_likelihood(settled) + 1e-4


def test_the_printed_update_weighs_by_components_and_partners():
    """Eq. 9: every joint state counts, so a visual state counts as often as it has partners, and w stands twice."""
    found, data = chains(), observed(4)
    start = converted(found, data, found.everywhere, Conversion(SOFT, EXACT, 0)).streams[1]
    printed = converted(found, data, found.everywhere, Conversion(SOFT, PRINTED, 1)).streams[1]
    seen = data.given(1, start.astype(np.float32))
    joint, _, _ = oracle.posteriors(found, seen)
    group = found.groups[1]
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
    found = chains(structure(MULTISTREAM, (THREE,)), components=(1, 1))
    data = observed(6)
    one, other = (converted(found, data, found.everywhere, Conversion(SOFT, update, 5)) for update in (EXACT, PRINTED))
    np.testing.assert_allclose(one.streams[1], other.streams[1], rtol=1e-4, atol=1e-5)
