"""What stands behind a frame, against all paths of small chains and against a fitted model's own numbers."""

from functools import cache

import numpy as np
import pytest

from engines.coupled.tiny import THREE, TWO, chains, observed, structure
from lipmotion.engines import engine_named
from lipmotion.engines.coupled.chains.structures import COUPLED, FACTORIAL, HMM, MULTISTREAM, SYSTEMS
from lipmotion.engines.coupled.explanation import (
    _regression_name,
    chain_states,
    explained,
    joint_state,
    lead_posteriors,
    leads,
    units_believed,
)
from lipmotion.motion import generation
from lipmotion.testing.examples import CHANNELS, examples, speech, timeline
from lipmotion.types import Explanation, NamedProbability
from lipmotion.types.progress import silent_monitor
from lipmotion.units import VISEME_OF
from oracles import coupled as oracle

KINDS = [
    (COUPLED, (THREE, TWO), 1),
    (COUPLED, (THREE, TWO), 0),
    (FACTORIAL, (THREE, TWO), 1),
    (MULTISTREAM, (THREE,), 1),
    (HMM, (THREE,), 1),
]
every = pytest.mark.parametrize(("kind", "sets", "limit"), KINDS)
SENTENCE = ("t", "aa", "p", "iy", "m", "uw", "s", "aa")


def small(kind, sets, limit):
    found, data = chains(structure(kind, sets, limit=limit)), observed()
    return found, found.inferred(data, found.everywhere).posteriors, oracle.posteriors(found, data)[0]


@every
def test_the_asynchrony_is_that_of_all_paths(kind, sets, limit):
    found, posteriors, joint = small(kind, sets, limit)
    product = found.transitions.product
    for chain, lead in enumerate(lead_posteriors(found, posteriors)):
        ahead = leads(found, chain)
        assert ahead == (tuple(range(-limit, limit + 1)) if chain else ())
        for column, states in enumerate(ahead):
            expected = joint[:, product.lead[chain] == states].sum(axis=1)
            np.testing.assert_allclose(lead[:, column], expected, atol=2e-5)
    for row in range(len(joint)):
        told = chain_states(found, posteriors, row)
        for chain, one in enumerate(told):
            if chain:
                assert one.expected_lead == pytest.approx(joint[row] @ product.lead[chain], abs=5e-5)


@every
def test_states_are_named_with_their_probabilities(kind, sets, limit):
    found, posteriors, joint = small(kind, sets, limit)
    product, of = found.transitions.product, found.structure
    for row in range(len(joint)):
        best = joint_state(found, posteriors, row)
        assert best.name == product.name(int(joint[row].argmax()))
        assert best.probability == pytest.approx(joint[row].max(), abs=2e-5)
        for chain, told in enumerate(chain_states(found, posteriors, row)):
            names = [of.state_name(chain, state) for state in range(of.counts[chain])]
            assert len(told.states) <= 3
            for one in told.states:
                state = names.index(one.name)
                expected = joint[row, product.chain_states[chain] == state].sum()
                assert one.probability == pytest.approx(expected, abs=2e-5)
            shown = [one.probability for one in told.states]
            assert shown == sorted(shown, reverse=True)
            assert shown[0] == pytest.approx(posteriors.chains[chain][row].max())


def test_a_state_says_unit_and_place():
    of = structure(chains=(THREE, TWO))
    assert of.state_name(0, 0) == f"{of.units[0][0]}.1"
    assert of.state_name(1, 3) == f"{of.units[1][1]}.2"
    assert of.name([0, 3]) == f"{of.state_name(0, 0)} | {of.state_name(1, 3)}"


def test_units_are_believed_as_their_states_are():
    found, posteriors, _ = small(*KINDS[0])
    first, second = units_believed(found, posteriors, slice(1, 4))
    for number, one in enumerate((first, second)):
        for unit, _ in enumerate(one.units):
            own = posteriors.chains[number][1:4, 2 * unit : 2 * unit + 2].sum(axis=1)
            np.testing.assert_allclose(one.probability[:, unit], own, rtol=1e-6)
    np.testing.assert_array_equal(second.lead, lead_posteriors(found, posteriors)[1][1:4])


def test_chains_without_a_limit_have_no_asynchrony_to_tell():
    found, posteriors, _ = small(FACTORIAL, (THREE, TWO), None)
    assert [lead.shape[1] for lead in lead_posteriors(found, posteriors)] == [0, 0]


@cache
def fitted(name):
    engine = engine_named("coupled", {**SYSTEMS[name], "mixtures": 2})
    model = engine.fit(examples(), silent_monitor).model
    spoken = speech(timeline(SENTENCE))
    inferred = engine.inferred(model, spoken.features.values, engine.lattice(model, spoken, slice(None)))
    return model, inferred


def explanation(name, row):
    model, inferred = fitted(name)
    return explained([Explanation(row / 100, row, None, "", {})], model, inferred, [row])[0]


@pytest.mark.parametrize("name", ["ph-HMM", "ph-vi-CHMM", "ph-vi-FHMM"])
@pytest.mark.parametrize("row", [0, 64, 75, 91])
def test_the_gaussian_is_the_most_responsible_one(name, row):
    model, inferred = fitted(name)
    found = explanation(name, row)
    for number, group in enumerate(model.chains.groups):
        shares, posterior = inferred.evidence.shares[number], inferred.posteriors.densities[number][row]
        weight = posterior[None] if shares is None else shares[row] * posterior
        for stream in group.streams:
            told = found.gaussians[stream]
            assert told.stream == model.chains.streams[stream]
            assert told.responsibility == pytest.approx(weight.max())
            assert (told.components, told.density != "") == (len(weight), True)
            component, place = np.argwhere(weight == weight.max())[0]
            assert told.component == component + 1
            density = inferred.lattice.densities[number][place]
            columns = group.columns[group.streams.index(stream)]
            mean, variance = (
                x[density, component, columns].astype(float) for x in (group.mixtures.means, group.mixtures.variances)
            )
            if stream == 0:
                error = (inferred.observed.streams[0][row] - mean) ** 2 / variance
                assert told.distance == pytest.approx(np.sqrt(error.mean()))
                assert told.channels == {}
                continue
            visual = model.visual[stream - 1]
            assert told.distance is None
            assert set(told.channels) == {channel.name for channel in CHANNELS}
            for column, direct in enumerate(model.space.direct_names):
                value = told.channels[direct]
                assert value.value == pytest.approx(mean[column] * visual.deviation[column] + visual.mean[column])
                assert value.deviation == pytest.approx(np.sqrt(variance[column]) * visual.deviation[column])


def test_densities_are_named_by_the_states_that_have_them():
    assert explanation("ph-vi-CHMM", 64).gaussians[0].density == "t.2"
    assert explanation("ph-vi-CHMM", 64).gaussians[1].density.startswith("al.")
    joint = explanation("ph-vi-FHMM", 64).gaussians
    assert joint[0].density == joint[1].density
    assert [part.partition(".")[0] for part in joint[0].density.split(" | ")] == ["t", "al"]


def test_the_regressions_share_what_is_believed_of_the_visual_chain():
    model, inferred = fitted("ph-vi-CHMM")
    around = model.around(inferred)
    gate = inferred.posteriors.chains[1]
    mean = model.follow[1][0].means(around, gate)
    for row in (64, 75, 91):
        (found,) = explanation("ph-vi-CHMM", row).regressions
        names = [model.chains.structure.state_name(1, state) for state in range(gate.shape[1])]
        for share in found.shares:
            assert share.probability == pytest.approx(gate[row, names.index(share.name)], abs=0.02)
        opening = mean[row, 0] * model.visual[0].deviation[0] + model.visual[0].mean[0]
        assert found.channels["opening"].value == pytest.approx(opening)


def test_in_silence_away_from_speech_the_mean_is_the_pose_at_rest():
    model, inferred = fitted("ph-vi-CHMM")
    assert model.resting(inferred.posteriors.chains[0])[5]
    (found,) = explanation("ph-vi-CHMM", 5).regressions
    assert found.shares == (NamedProbability("rest", 1.0),)
    assert found.channels["opening"].value == pytest.approx(model.rest[0])


def test_a_regression_of_several_places_is_named_by_its_viseme():
    of = structure(chains=(THREE, TWO))
    kind = np.repeat(np.arange(len(of.units[0])), of.states)
    first = VISEME_OF[of.chains[0].phones(of.units[0][0])[0]]
    assert _regression_name(of, 0, kind, 0) == first
    assert _regression_name(of, 0, np.arange(len(kind)), 1) == f"{first}.2"


def test_recordings_of_several_stretches_are_explained_as_one(monkeypatch):
    monkeypatch.setattr(generation, "STRETCH", 60)
    monkeypatch.setattr(generation, "MARGIN", 50)
    engine, (model, _) = engine_named("coupled", {**SYSTEMS["ph-vi-CHMM"], "mixtures": 2}), fitted("ph-vi-CHMM")
    spoken = speech(timeline(SENTENCE))
    beliefs = engine.beliefs(model, spoken)
    result = engine.generate(model, spoken)
    frames = [3, 59, 60, 61, 119, 120, 150]
    for row, found in zip(frames, engine.explain(model, spoken, frames), strict=True):
        assert found.state == result.trace.states[result.trace.frames[row]] == found.joint.name
        assert list(found.chains[1].lead.values()) == pytest.approx(beliefs[1].lead[row].tolist())
        for chain, own in enumerate(found.chains):
            unit = beliefs[chain].units.index(own.states[0].name.rpartition(".")[0])
            assert beliefs[chain].probability[row, unit] >= own.states[0].probability - 1e-6


def test_what_has_no_path_has_no_chains():
    model, inferred = fitted("ph-HMM")
    impossible = type(inferred.posteriors)(*[*vars(inferred.posteriors).values()][:4], -np.inf)
    nothing = Explanation(0.0, 0, None, "", {})
    lost = type(inferred)(inferred.observed, inferred.lattice, inferred.evidence, impossible)
    assert explained([nothing], model, lost, [0]) == [nothing]
