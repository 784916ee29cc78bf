from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from engines.coupled.tiny import KINDS, chains, observations, structure
from lipmotion import engines, types
from lipmotion.engines.coupled.engine import explain_frames, find_joint_state, infer_units, list_chain_states
from lipmotion.motion import generation
from lipmotion.testing import CHANNELS, examples, speech, timeline
from oracles import coupled as oracle

every = pytest.mark.parametrize(("kind", "sets", "limit"), [kind for kind in KINDS if kind[2] is not None])
SENTENCE = ("t", "aa", "p", "iy", "m", "uw", "s", "aa")


def small(kind, sets, limit):
    found, data = chains(structure(kind, sets, limit=limit)), observations()
    return found, found.infer(data, found.full_lattice).posteriors, oracle.posteriors(found, data)[0]


@every
def test_the_asynchrony_is_that_of_all_paths(kind, sets, limit):
    found, posteriors, joint = small(kind, sets, limit)
    product = found.transitions.product
    for chain, units in enumerate(infer_units(found, posteriors, slice(None))):
        assert units.leads == (tuple(range(-limit, limit + 1)) if chain else ())
        for column, states in enumerate(units.leads):
            expected = joint[:, product.lead[chain] == states].sum(axis=1)
            np.testing.assert_allclose(units.lead[:, column], expected, atol=2e-5)
    for row in range(len(joint)):
        for chain, states in enumerate(list_chain_states(found, posteriors, row)):
            if chain:
                assert states.expected_lead == pytest.approx(joint[row] @ product.lead[chain], abs=5e-5)


@every
def test_states_are_named_with_their_probabilities(kind, sets, limit):
    found, posteriors, joint = small(kind, sets, limit)
    product, of = found.transitions.product, found.structure
    for row in range(len(joint)):
        best = find_joint_state(found, posteriors, row)
        assert best.name == of.name(product.chain_states[:, joint[row].argmax()].tolist())
        assert best.probability == pytest.approx(joint[row].max(), abs=2e-5)
        for chain, explained in enumerate(list_chain_states(found, posteriors, row)):
            names = [of.state_name(chain, state) for state in range(of.state_counts[chain])]
            assert len(explained.states) <= 3
            for one in explained.states:
                state = names.index(one.name)
                expected = joint[row, product.chain_states[chain] == state].sum()
                assert one.probability == pytest.approx(expected, abs=2e-5)
            shown = [one.probability for one in explained.states]
            assert shown == sorted(shown, reverse=True)
            assert shown[0] == pytest.approx(posteriors.chains[chain][row].max())


def test_posteriors_of_units_are_sums_over_their_states():
    found, posteriors, _ = small(*KINDS[0])
    first, second = infer_units(found, posteriors, slice(1, 4))
    for number, one in enumerate((first, second)):
        for unit, _ in enumerate(one.units):
            own = posteriors.chains[number][1:4, 2 * unit : 2 * unit + 2].sum(axis=1)
            np.testing.assert_allclose(one.probability[:, unit], own, rtol=1e-6)
    np.testing.assert_array_equal(second.lead, infer_units(found, posteriors, slice(None))[1].lead[1:4])


def coupled_options(name):
    config = engines.create_engine(preset=name).config
    return {key: getattr(config, key) for key in ("structure", "chains", "asynchrony")} | {"mixtures": 2}


@cache
def fitted(name):
    engine = engines.engine_named("coupled", coupled_options(name))
    model = engine.fit(examples(4), types.silent_monitor).model
    spoken = speech(timeline(SENTENCE))
    inference = engine.infer(model, spoken, slice(None))
    return model, inference


def explanation(name, row):
    model, inference = fitted(name)
    return explain_frames([types.Explanation(row / 100, row, None, "", {})], model, inference, [row])[0]


@pytest.mark.parametrize("name", ["ph-vi-CHMM", pytest.param("ph-vi-FHMM", marks=pytest.mark.long)])
@pytest.mark.parametrize("row", [0, 64, 91])
def test_the_gaussian_is_the_most_responsible_one(name, row):
    model, inference = fitted(name)
    found = explanation(name, row)
    for number, group in enumerate(model.chains.groups):
        responsibilities = inference.responsibilities[number]
        posterior = inference.posteriors.densities[number][row]
        weight = posterior[None] if responsibilities is None else responsibilities[row] * posterior
        for stream in group.streams:
            explained = found.gaussians[stream]
            assert explained.stream == model.chains.streams[stream]
            assert explained.responsibility == pytest.approx(weight.max())
            assert (explained.components, explained.density != "") == (len(weight), True)
            component, position = np.argwhere(weight == weight.max())[0]
            assert explained.component == component + 1
            density = inference.lattice.densities[number][position]
            columns = group.columns[group.streams.index(stream)]
            mean, variance = (
                x[density, component, columns].astype(float) for x in (group.mixtures.means, group.mixtures.variances)
            )
            if stream == 0:
                error = (inference.observations.streams[0][row] - mean) ** 2 / variance
                assert explained.distance == pytest.approx(np.sqrt(error.mean()))
                assert explained.channels == {}
                continue
            visual = model.visual[stream - 1]
            assert explained.distance is None
            assert set(explained.channels) == {channel.name for channel in CHANNELS}
            for column, direct in enumerate(model.space.direct_names):
                value = explained.channels[direct]
                assert value.value == pytest.approx(mean[column] * visual.deviation[column] + visual.mean[column])
                assert value.deviation == pytest.approx(np.sqrt(variance[column]) * visual.deviation[column])


@pytest.mark.long
def test_recordings_of_several_blocks_are_explained_as_one():
    border = generation.BLOCK_FRAMES
    engine, (model, _) = engines.engine_named("coupled", coupled_options("ph-vi-CHMM")), fitted("ph-vi-CHMM")
    silence_s = border / 100 - 1  # the border lies in the sentence
    spoken = speech(
        types.Timeline((types.Span(0, silence_s, types.Unit("sil")), *timeline(SENTENCE).shifted(silence_s)))
    )
    posteriors = engine.posteriors(model, spoken)
    result = engine.generate(model, spoken)
    frames = [3, *range(border - 2, border + 3), border + 50]
    for row, found in zip(frames, engine.explain(model, spoken, frames), strict=True):
        assert found.state == result.trace.states[result.trace.frames[row]] == found.joint.name
        assert list(found.chains[1].lead.values()) == pytest.approx(posteriors[1].lead[row].tolist())
        for chain, own in enumerate(found.chains):
            unit = posteriors[chain].units.index(own.states[0].name.rpartition(".")[0])
            assert posteriors[chain].probability[row, unit] >= own.states[0].probability - 1e-6


def test_without_a_path_an_explanation_has_no_chains():
    model, inference = fitted("ph-vi-CHMM")
    impossible = type(inference.posteriors)(*[*vars(inference.posteriors).values()][:4], -np.inf)
    nothing = types.Explanation(0.0, 0, None, "", {})
    lost = type(inference)(inference.observations, inference.lattice, inference.responsibilities, impossible)
    assert explain_frames([nothing], model, lost, [0]) == [nothing]


def test_it_leans_on_recognised_phones_as_far_as_the_voice_is_unknown_or_words_confirm_them():
    engine = engines.engine_named("coupled", {"states": 1, "asynchrony": 0, "mixtures": 1, "closures": False})
    model = engine.fit(examples(4), types.silent_monitor).model
    recognised = replace(speech(timeline(SENTENCE)), units_known=False)

    def motion(of, confidence, voice):
        return engine.generate(of, replace(recognised, confidence=confidence, voice=voice)).motion.values

    without = motion(replace(model, prior=None), 1.0, 1.0)
    np.testing.assert_allclose(motion(model, 0.0, 1.0), without)
    full = motion(model, 1.0, 1.0)
    assert np.abs(full - without).max() > 1e-3
    np.testing.assert_allclose(motion(model, 0.0, 0.0), full)
    half = np.abs(motion(model, 0.0, 0.5) - without).max()
    assert 1e-4 < half < np.abs(full - without).max()
