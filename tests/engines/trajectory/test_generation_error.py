"""Training for the least error of the generated trajectory."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from engines.synthetic import examples
from lipmotion.engines.trajectory import generation_error as module
from lipmotion.engines.trajectory.engine import TrajectoryConfig
from lipmotion.engines.trajectory.train import fit_trajectory, training_clip
from lipmotion.engines.trajectory.training_data import rows_of
from lipmotion.kernels.banded import generate
from lipmotion.types.progress import silent_monitor

HOW = TrajectoryConfig(parts=3, silent_parts=7, components=2, axes=20).learning


@pytest.fixture(scope="module")
def start():
    corpus = examples(6)
    model = fit_trajectory(corpus, HOW, silent_monitor)
    values = [model.space.reduce(one.motion.values) for one in corpus]
    return model.emission, [training_clip(one, x, HOW.cut) for one, x in zip(corpus, values, strict=True)]


def error(emission, observed):
    total = np.zeros(emission.means.shape[2])
    for one in observed:
        means, precisions = emission.statistics(rows_of(emission, one.places, HOW.cut), one.features, slice(None))
        total += np.square(generate(means, precisions)[0][one.frames] - one.rows[:, 0]).sum(axis=0)
    return total


def test_every_step_lowers_the_error_on_the_training_list(start):
    emission, observed = start
    errors = [
        error(module.minimise_generation_error(emission, observed, replace(HOW, trajectory_steps=steps)), observed)
        for steps in range(5)
    ]
    assert errors[0] == pytest.approx(error(emission, observed))
    for before, after in pairwise(errors):
        assert (after <= before * (1 + 1e-5)).all()
    assert errors[-1][0] < 0.8 * errors[0][0]


def test_the_gradient_is_that_of_finite_differences(start):
    emission, observed = start
    clips = [module._clip(emission, one, HOW) for one in observed[:2]]
    gradient = module._adjoint(clips, [clip.error for clip in clips], emission.means.shape)
    draw = np.random.default_rng(0)
    direction = draw.normal(size=emission.means.shape)
    moved = list(module._forward(clips, direction))

    def half(step: float) -> float:
        return sum(0.5 * np.square(c.error - step * m).sum() for c, m in zip(clips, moved, strict=True))

    assert (half(-1e-3) - half(1e-3)) / 2e-3 == pytest.approx((gradient * direction).sum(), rel=1e-6)


def test_no_steps_change_nothing(start):
    emission, observed = start
    same = module.minimise_generation_error(emission, observed, replace(HOW, trajectory_steps=0))
    assert np.array_equal(same.means, emission.means)
