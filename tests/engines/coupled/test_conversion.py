from dataclasses import replace

import numpy as np
import pytest

from engines.coupled.tiny import KINDS, chains, observations, structure
from lipmotion.engines import engine_named
from lipmotion.engines.coupled import conversion
from lipmotion.engines.coupled.conversion import EXACT, PRINTED, SOFT, VITERBI, convert
from lipmotion.stats.curves import with_dynamics
from lipmotion.testing import example, examples, speech, timeline
from lipmotion.types import silent_monitor
from oracles import coupled as oracle

PLAIN = {"mixtures": 1, "closures": False, "articulation": False}
every = pytest.mark.parametrize(("kind", "sets", "limit"), KINDS)


@every
@pytest.mark.parametrize("start", [SOFT, VITERBI])
def test_speech_and_streams_become_more_likely_at_every_step(kind, sets, limit, start):
    for seed in range(2):
        model = chains(structure(kind, sets, limit=limit), seed=seed)
        _, log_likelihoods = convert(model, observations(12, seed=seed), model.full_lattice, start, EXACT, 15)
        assert len(log_likelihoods) > 2
        assert min(np.diff(log_likelihoods)) > -2e-6


def test_the_soft_start_is_the_precision_weighted_mean_over_all_paths():
    model, data = chains(), observations(4)
    (lips,), _ = convert(model, data, model.full_lattice, SOFT, EXACT, 0)
    precision, weighted = oracle.component_statistics(model, data.without_visual_streams(), 1, 1)
    np.testing.assert_allclose(lips, weighted / precision, rtol=1e-3, atol=1e-4)


def test_values_of_visual_streams_are_ignored():
    model = chains()
    one, other = observations(6, seed=1), observations(6, seed=2)
    other = one.with_visual_streams(other.streams[1:])
    results = [convert(model, data, model.full_lattice, max_steps=4)[0][0] for data in (one, other)]
    np.testing.assert_array_equal(*results)


def test_the_viterbi_start_is_the_means_along_the_best_path():
    model, data = chains(), observations(5)
    (lips,), _ = convert(model, data, model.full_lattice, VITERBI, EXACT, 0)
    path, _ = max(oracle.paths(model, data.without_visual_streams()), key=lambda pair: pair[1])
    group = model.groups[1]
    means = (np.exp(group.mixtures.log_weights)[:, :, None] * group.mixtures.means).sum(axis=1)
    expected = means[group.tie[list(path)]]
    np.testing.assert_allclose(lips, expected, rtol=1e-5)
    (lips,), _ = convert(model, data, model.full_lattice, VITERBI, EXACT, 0, np.array(path[::-1]))
    np.testing.assert_allclose(lips, expected[::-1], rtol=1e-5)


def test_the_maximiser_is_where_the_derivative_vanishes():
    """Σ γ(q, k) Σ⁻¹ (μ − o) = 0: the joint likelihood itself is stationary where EM stands still."""
    model, data = chains(seed=3), observations(4, seed=3)
    (lips,), _ = convert(model, data, model.full_lattice, SOFT, EXACT, 400)

    def log_likelihood(values):
        return oracle.posteriors(model, data.with_visual_streams([values.astype(np.float32)]))[2]

    for frame in range(4):
        for step in (-0.02, 0.02):
            moved = lips.copy()
            moved[frame] += step
            assert log_likelihood(moved) <= log_likelihood(lips) + 1e-4


def test_the_printed_update_weighs_by_components_and_partners():
    """Eq. 9: every joint state counts, so a visual state counts as often as it has partners, and w stands twice."""
    model, data = chains(), observations(4)
    (start,), _ = convert(model, data, model.full_lattice, SOFT, EXACT, 0)
    (printed,), _ = convert(model, data, model.full_lattice, SOFT, PRINTED, 1)
    seen = data.with_visual_streams([start.astype(np.float32)])
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
                top = top + weight * inverse * group.mixtures.means[density, component]
                bottom = bottom + weight * inverse
        expected[frame] = top / bottom
    np.testing.assert_allclose(printed, expected, rtol=1e-3, atol=1e-4)


def utterances(count=3, frames=60, states=4, seed=0) -> list[conversion.RegressionUtterance]:
    draw = np.random.default_rng(seed)
    result = []
    for _ in range(count):
        first = draw.dirichlet(np.full(states, 0.2), frames).astype(np.float32)
        features = draw.normal(0, 1, (frames, 39)).astype(np.float32)
        visual = draw.dirichlet(np.full(6, 0.2), frames).astype(np.float32)
        observed = draw.random(frames) < 0.8
        target = (features[:, :2] + visual[:, :2] * 3).astype(np.float32)
        target = np.where(observed[:, None], target, 99).astype(np.float32)
        result.append(conversion.RegressionUtterance(features, first, [visual], [target], observed))
    return result


def test_the_regressions_are_ridges_one_towards_the_other():
    """By normal equations over explicitly weighted rows: all, then families, then regressions."""
    data = utterances()
    inputs = conversion.fit_regression_inputs(np.eye(4, dtype=np.float32), data)
    regression_of_state, family = np.array([0, 0, 1, 1, 2, 2]), np.array([0, 0, 1])
    found = conversion.fit_visual_regression(inputs, data, 0, regression_of_state, family)
    z = np.concatenate([inputs(one.features, one.reduced_posteriors)[one.observed] for one in data]).astype(float)
    target = np.concatenate([one.targets[0][one.observed] for one in data]).astype(float)
    weight = np.concatenate(
        [conversion.weigh_regressions(one.chain_posteriors[0], regression_of_state, 3)[one.observed] for one in data]
    ).astype(float)

    def solved(rows, prior, strength):
        system = z.T @ (rows[:, None] * z) + strength * np.eye(z.shape[1])
        return np.linalg.solve(system, z.T @ (rows[:, None] * target) + strength * prior)

    shared = solved(weight.sum(axis=1), 0 * np.zeros((z.shape[1], 2)), conversion.SHARED_RIDGE * len(z))
    for number in range(3):
        above = solved(weight[:, family == family[number]].sum(axis=1), shared, conversion.OWN_RIDGE)
        np.testing.assert_allclose(
            found.coefficients[number], solved(weight[:, number], above, conversion.OWN_RIDGE), atol=2e-3
        )


def test_expected_means_and_precisions_are_sums_over_states():
    draw = np.random.default_rng(0)
    regression = conversion.VisualRegression(
        np.array([0, 1, 1]),
        draw.normal(0, 1, (2, 5, 3)).astype(np.float32),
        draw.uniform(0.5, 2, (3, 3)).astype(np.float32),
    )
    posterior = np.array([[0.5, 0.2, 0.3], [0.0, 1.0, 0.0], [0.995, 0.005, 0.0]], np.float32)
    inputs = draw.normal(0, 1, (3, 5)).astype(np.float32)
    expected = [
        0.5 * inputs[0] @ regression.coefficients[0] + 0.5 * inputs[0] @ regression.coefficients[1],
        inputs[1] @ regression.coefficients[1],
        inputs[2] @ regression.coefficients[0],  # half a percent is left out
    ]
    np.testing.assert_allclose(regression.means(inputs, posterior), expected, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(regression.precisions(posterior), posterior @ (1 / regression.variances), rtol=1e-6)


@pytest.mark.parametrize("regression", [True, pytest.param(False, marks=pytest.mark.long)])
def test_the_regression_brings_motion_closer(regression):
    engine = engine_named("coupled", PLAIN | {"acoustic_regression": regression})
    model = engine.fit(examples(6), silent_monitor).model
    assert (model.regression is not None) is regression
    held_out = example(("t", "aa", "p", "iy", "m", "uw", "s", "aa"), seed=77)
    generated = engine.generate(model, held_out.speech).motion
    error = np.sqrt(np.mean((generated["opening"] - held_out.motion["opening"]) ** 2))
    assert error < (0.02 if regression else 0.05)


@pytest.mark.long
def test_the_mouth_rests_in_long_silence():
    engine = engine_named("coupled", {"mixtures": 1})
    model = engine.fit(examples(), silent_monitor).model
    generated = engine.generate(model, speech(timeline(("aa", "t", "aa")))).motion["opening"]
    opening = model.rest_pose[model.space.direct_names.index("opening")]
    assert np.abs(generated[:30] - opening).max() < 2e-3
    assert generated[30:].max() > 0.15


@pytest.mark.long
def test_unknown_voices_follow_their_encoding():
    draw, engine = np.random.default_rng(0), engine_named("coupled", PLAIN)
    heard = [
        replace(each, speech=replace(each.speech, encoding=draw.normal(size=(len(each.valid), 64)).astype(np.float16)))
        for each in examples(4)
    ]
    model = engine.from_arrays(engine.to_arrays(engine.fit(heard, silent_monitor).model))
    known, unknown = (replace(heard[0].speech, voice=voice) for voice in (1.0, 0.5))
    assert np.array_equal(
        engine.generate(model, known).motion.values, engine.generate(model, replace(known, encoding=None)).motion.values
    )
    whole = slice(0, len(heard[0].valid))
    means, precisions = model.motion_statistics(engine.infer(model, unknown, whole))
    (found, sharp), _ = engine._statistics(model, unknown, whole)
    predicted = with_dynamics(model.encoding.predict(unknown)[0])
    np.testing.assert_allclose(found, 0.2 * means + 0.8 * predicted)
    np.testing.assert_allclose(sharp, 0.2 * precisions + 0.8 / model.encoding.variances)
    assert engine.fit(examples(4), silent_monitor).model.encoding is None
