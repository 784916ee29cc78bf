import numpy as np
import pytest

from engines.coupled.tiny import TWO, structure
from lipmotion.engines.coupled.config import CoupledConfig
from lipmotion.engines.coupled.conversion.regression import (
    CONSTANT,
    OWN_RIDGE,
    SHARED_RIDGE,
    Following,
    Heard,
    belief_axes,
    fit_following,
    fit_surroundings,
    gates,
)
from lipmotion.engines.coupled.engine import CoupledEngine
from lipmotion.engines.coupled.training.fit import _kinds, fit_coupled
from lipmotion.testing.examples import example, examples, speech, timeline
from lipmotion.types.progress import silent_monitor


def heard(count=3, frames=60, states=4, seed=0) -> list[Heard]:
    draw = np.random.default_rng(seed)
    made = []
    for _ in range(count):
        posterior = draw.dirichlet(np.full(states, 0.2), frames).astype(np.float32)
        features = draw.normal(0, 1, (frames, 39)).astype(np.float32)
        gate = draw.dirichlet(np.full(6, 0.2), frames).astype(np.float32)
        seen = draw.random(frames) < 0.8
        target = (features[:, :2] + gate[:, :2] * 3).astype(np.float32)
        made.append(Heard(features, posterior, [gate], [np.where(seen[:, None], target, 99).astype(np.float32)], seen))
    return made


def test_the_regressions_are_ridges_one_towards_the_other():
    """By normal equations over explicitly weighted rows: all, then families, then kinds."""
    data = heard()
    around = fit_surroundings(np.eye(4, dtype=np.float32), data)
    kind, family = np.array([0, 0, 1, 1, 2, 2]), np.array([0, 0, 1])
    found = fit_following(around, data, 0, kind, family)
    z = np.concatenate([around(one.features, one.belief)[one.seen] for one in data]).astype(float)
    target = np.concatenate([one.targets[0][one.seen] for one in data]).astype(float)
    weight = np.concatenate([gates(one.gates[0], kind, 3)[one.seen] for one in data]).astype(float)

    def solved(rows, prior, strength):
        system = z.T @ (rows[:, None] * z) + strength * np.eye(z.shape[1])
        return np.linalg.solve(system, z.T @ (rows[:, None] * target) + strength * prior)

    shared = solved(weight.sum(axis=1), 0 * np.zeros((z.shape[1], 2)), SHARED_RIDGE * len(z))
    for number in range(3):
        above = solved(weight[:, family == family[number]].sum(axis=1), shared, OWN_RIDGE)
        np.testing.assert_allclose(found.coefficients[number], solved(weight[:, number], above, OWN_RIDGE), atol=2e-3)


def test_expected_means_and_precisions_are_sums_over_states():
    draw = np.random.default_rng(0)
    following = Following(
        np.array([0, 1, 1]),
        draw.normal(0, 1, (2, 5, 3)).astype(np.float32),
        draw.uniform(0.5, 2, (3, 3)).astype(np.float32),
    )
    gate = np.array([[0.5, 0.2, 0.3], [0.0, 1.0, 0.0], [0.995, 0.005, 0.0]], np.float32)
    around = draw.normal(0, 1, (3, 5)).astype(np.float32)
    expected = [
        0.5 * around[0] @ following.coefficients[0] + 0.5 * around[0] @ following.coefficients[1],
        around[1] @ following.coefficients[1],
        around[2] @ following.coefficients[0],  # half a percent is left out
    ]
    np.testing.assert_allclose(following.means(around, gate), expected, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(following.precisions(gate), gate @ (1 / following.variances), rtol=1e-6)


def test_surroundings_hold_a_constant_and_few_axes():
    data = heard(states=4)
    axes = belief_axes(one.belief for one in data)
    assert axes.shape == (4, 4)
    np.testing.assert_allclose(axes.T @ axes, np.eye(4), atol=1e-5)
    around = fit_surroundings(axes, data)
    z = around(data[0].features, data[0].belief)
    assert len(z) == 60
    assert (z[:, -1] == CONSTANT).all()
    assert (
        np.abs(np.concatenate([around(o.features, o.belief @ axes.T)[:, :-1] for o in data]).mean(axis=0)).max() < 1e-3
    )


def test_every_viseme_has_a_regression_for_each_place():
    kind, family = _kinds(structure(states=2), 1)
    assert kind.tolist() == [2, 3, 0, 1] or kind.tolist() == [0, 1, 2, 3]
    assert family.tolist() == [0, 0, 1, 1]
    assert len(TWO.units) == 2


@pytest.mark.parametrize("acoustic_regression", [True, False])
def test_following_brings_motion_closer(follows):
    config = CoupledConfig(follows=follows, mixtures=1, closures=False)
    model = fit_coupled(examples(), config, silent_monitor)
    assert (model.follow is not None) is follows
    unheard = example(("t", "aa", "p", "iy", "m", "uw", "s", "aa"), seed=77)
    generated = CoupledEngine(config).generate(model, unheard.speech).motion
    error = np.sqrt(np.mean((generated["opening"] - unheard.motion["opening"]) ** 2))
    assert error < (0.02 if follows else 0.05)


def test_the_mouth_rests_in_long_silence():
    config = CoupledConfig(mixtures=1)
    engine = CoupledEngine(config)
    model = fit_coupled(examples(), config, silent_monitor)
    generated = engine.generate(model, speech(timeline(("aa", "t", "aa")))).motion["opening"]
    opening = model.rest[model.space.direct_names.index("opening")]
    assert np.abs(generated[:30] - opening).max() < 2e-3
    assert generated[30:].max() > 0.15
