import numpy as np
import pytest

from lipmotion.kernels.factorial import infer_factorial
from lipmotion.kernels.factorial_loops import FactorialLogLikelihoods, Loop, find_factorial_path


def random_loop(draw, states: int, units: int) -> Loop:
    stay = draw.uniform(0.3, 0.9, (states, units))
    enter = draw.dirichlet(np.ones(units), size=units)
    initial = draw.dirichlet(np.ones(units * states)).reshape(states, units)
    return Loop(stay, 1 - stay[:-1], 1 - stay[-1], enter, initial, draw.uniform(0.1, 1, (states, units)))


def random_model(seed: int, frames: int, shapes=((2, 2), (2, 1)), spread: float = 2.0, pairs: int = 3):
    draw = np.random.default_rng([seed, 3])
    audio, visual = (random_loop(draw, *shape) for shape in shapes)
    sizes = audio.stay.size, visual.stay.size
    chosen = draw.choice(sizes[0] * sizes[1], size=min(pairs, sizes[0] * sizes[1]), replace=False)
    logs = (draw.normal(-20, spread, (frames, size)) for size in sizes)
    own = draw.normal(-38, spread, (frames, len(chosen)))
    return audio, visual, FactorialLogLikelihoods(*logs, own, np.stack(np.unravel_index(chosen, sizes), axis=1))


def test_posteriors_sum_to_one_and_counts_are_as_many_as_steps():
    audio, visual, logs = random_model(4, 150, ((3, 6), (3, 4)), 20.0, 10)
    logs = FactorialLogLikelihoods(*(part.astype(np.float32) for part in logs[:3]), logs.pairs)
    found = infer_factorial(audio, visual, logs)
    for posterior, counts in ((found.audio, found.audio_counts), (found.visual, found.visual_counts)):
        assert posterior.sum(axis=1) == pytest.approx(np.ones(150), abs=1e-6)
        assert sum(c.sum() for c in counts[:3]) == pytest.approx(149, abs=0.015)
        frames = posterior.reshape(150, *counts.stay.shape)
        assert counts.enter.sum(axis=0) + counts.stay[0] == pytest.approx(frames[1:, 0].sum(axis=0), abs=1e-4)


def test_a_recording_without_a_path_has_probability_0():
    audio, visual, logs = random_model(7, 5, pairs=0)
    logs.visual[3] = -np.inf
    found = infer_factorial(audio, visual, logs)
    assert found.log_likelihood == -np.inf
    assert not any(part.any() for part in (*found[:3], *found.audio_counts, *found.visual_counts))
    assert find_factorial_path(audio, visual, logs)[2] == -np.inf


def test_single_precision_is_close_however_loud():
    for spread in (5.0, 1e3):
        audio, visual, logs = random_model(8, 60, ((3, 8), (3, 5)), spread, 30)
        single = FactorialLogLikelihoods(*(part.astype(np.float32) for part in logs[:3]), logs.pairs)
        double = FactorialLogLikelihoods(*(part.astype(np.float64) for part in single[:3]), logs.pairs)
        found, wanted = (infer_factorial(audio, visual, given) for given in (single, double))
        assert found.audio == pytest.approx(wanted.audio, abs=1e-4)
        assert found.pair == pytest.approx(wanted.pair, abs=1e-4)
        assert found.audio_counts.enter == pytest.approx(wanted.audio_counts.enter, abs=1e-3)
        assert found.log_likelihood == pytest.approx(wanted.log_likelihood, rel=1e-6)
