from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion.stats import network_training, networks
from lipmotion.stats.network_training import TrainingPlan, TrainingSequence, fit_network
from oracles.statistics import recurrent_outputs


def slopes(
    network: Any, arrays: Iterable[NDArray[np.float32]], batch: list[TrainingSequence], step: float
) -> tuple[list[float], list[float]]:
    """Return gradients at some places of the arrays, and the differences of the error at both sides of them."""
    batch[0].valid[2] = False

    def differentiate() -> tuple[float, Any]:
        return network_training._differentiate(network, batch, np.array([0.3, 0.7], np.float32), 0.0, 0)

    rng, gradients, differences = np.random.default_rng(0), [], []
    for array, gradient in zip(arrays, differentiate()[1], strict=True):
        assert gradient.shape == array.shape
        for index in [tuple(rng.integers(size) for size in array.shape) for _ in range(4)]:
            before, errors = array[index], []
            for value in (before + step, before - step):
                array[index] = value
                errors.append(differentiate()[0])
            array[index] = before
            differences.append((errors[0] - errors[1]) / (2 * step))
            gradients.append(float(gradient[index]))
    return gradients, differences


def trained(network: Any, sequences: list[TrainingSequence], steps: int, rate: float) -> tuple[list[float], Any]:
    """Return the errors of all steps, and the network after them."""
    errors: list[float] = []
    plan = TrainingPlan(steps=steps, batch_size=4, rate=rate, dropout=0.0, seed=0)
    give, keep = lambda _, number: sequences[number], lambda _, error: errors.append(error)
    return errors, fit_network(network, give, len(sequences), np.ones(2), plan, keep)


def shifted(length: int = 40, seed: int = 0) -> TrainingSequence:
    """A sequence whose targets are the inputs of the step before, times two."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((length, 3)).astype(np.float32)
    y = np.zeros((length, 2), np.float32)
    y[1:] = 2 * x[:-1, :2]
    return TrainingSequence(x, y, np.ones(length, bool))


def test_gradients_are_those_of_differences() -> None:
    network = networks.make_network(3, 5, 2, (1, 2), seed=1)
    arrays = [array for layer in (*network.layers, network.output) for array in layer]
    gradients, differences = slopes(network, arrays, [shifted(9), shifted(6, 1)], 2e-3)
    # a step may cross a corner of max(0, x), where the difference is between two slopes
    assert np.median(np.abs(np.array(differences) - gradients)) < 1e-3
    assert np.corrcoef(differences, gradients)[0, 1] > 0.995


def test_steps_beyond_the_reach_change_nothing_also_over_the_borders_of_blocks() -> None:
    network = networks.make_network(3, 8, 2, (1, 2, 4), seed=0)
    x = shifted(60).inputs.astype(np.float32)
    changed = x.copy()
    changed[30] += 1
    moved = np.abs(network(changed) - network(x)).max(axis=1) > 0
    assert network.reach == 7
    assert not moved[: 30 - 7].any()
    assert not moved[30 + 8 :].any()
    assert moved[30]
    x = shifted(networks.BLOCK + 100).inputs.astype(np.float32)
    border = slice(networks.BLOCK - 40, networks.BLOCK + 40)
    alone = network(x[border.start - 7 : border.stop + 7])[7:-7]
    np.testing.assert_allclose(network(x)[border], alone, atol=1e-5)


def test_it_learns_what_depends_on_a_neighbour() -> None:
    errors, network = trained(
        networks.make_network(3, 16, 2, (1, 1), 0), [shifted(seed=number) for number in range(8)], 150, 1e-2
    )
    assert np.mean(errors[-10:]) < 0.05 * np.mean(errors[:5])
    unseen = shifted(seed=99)
    assert np.corrcoef(network(unseen.inputs.astype(np.float32))[:, 0], unseen.targets[:, 0])[0, 1] > 0.97


def neighbours(length: int = 30, seed: int = 0) -> TrainingSequence:
    """A sequence whose targets are the inputs a step before and a step after."""
    x = np.random.default_rng(seed).standard_normal((length, 2)).astype(np.float32)
    y = np.zeros((length, 2), np.float32)
    y[1:, 0], y[:-1, 1] = x[:-1, 0], x[1:, 1]
    return TrainingSequence(x, y, np.ones(length, bool))


@pytest.mark.parametrize("length", [7, 4300])
def test_it_is_what_its_equations_say_also_where_it_is_computed_in_pieces(length: int) -> None:
    network, x = networks.make_recurrent_network(2, 4, 3, 2, seed=0), neighbours(length).inputs.astype(np.float32)
    np.testing.assert_allclose(network(x), recurrent_outputs(network, x), atol=1e-5 if length < 9 else 1e-3)
    assert network(x[:0]).shape == (0, 3)


def test_gradients_of_cells_are_those_of_differences() -> None:
    network = networks.make_recurrent_network(2, 4, 2, 2, seed=1)
    gradients, differences = slopes(network, network.parameters, [neighbours(9), neighbours(6, 1)], 5e-3)
    assert differences == pytest.approx(gradients, abs=1e-3)


def train() -> tuple[list[float], networks.RecurrentNetwork]:
    network = networks.make_recurrent_network(2, 12, 2, 1, seed=0)
    return trained(network, [neighbours(seed=number) for number in range(8)], 60, 5e-2)


def test_cells_learn_what_it_must_remember_in_both_directions_and_always_the_same() -> None:
    errors, network = train()
    assert np.mean(errors[-10:]) < 0.1 * np.mean(errors[:5])
    unseen = neighbours(seed=99)
    made = network(unseen.inputs.astype(np.float32))
    assert all(np.corrcoef(made[:, each], unseen.targets[:, each])[0, 1] > 0.9 for each in range(2))
    assert train()[0][:5] == pytest.approx(errors[:5])
