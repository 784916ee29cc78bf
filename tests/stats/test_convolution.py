import numpy as np
import pytest

from lipmotion.stats import convolution, network_training
from lipmotion.stats.network_training import TrainingSequence
from stats.networks import slopes, trained


def sequence(length: int = 40, seed: int = 0) -> TrainingSequence:
    """A sequence whose targets are the inputs of the step before, times two."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((length, 3)).astype(np.float32)
    y = np.zeros((length, 2), np.float32)
    y[1:] = 2 * x[:-1, :2]
    return TrainingSequence(x, y, np.ones(length, bool))


def test_gradients_are_those_of_differences() -> None:
    network = convolution.make_network(3, 5, 2, (1, 2), seed=1)
    arrays = [array for layer in (*network.layers, network.output) for array in layer]
    gradients, differences = slopes(network, arrays, [sequence(9), sequence(6, 1)], 2e-3)
    # a step may cross a corner of max(0, x), where the difference is between two slopes
    assert np.median(np.abs(np.array(differences) - gradients)) < 1e-3
    assert np.corrcoef(differences, gradients)[0, 1] > 0.995


def test_steps_beyond_the_reach_change_nothing_also_over_the_borders_of_blocks() -> None:
    network = convolution.make_network(3, 8, 2, (1, 2, 4), seed=0)
    x = sequence(60).inputs.astype(np.float32)
    changed = x.copy()
    changed[30] += 1
    moved = np.abs(network(changed) - network(x)).max(axis=1) > 0
    assert network.reach == 7
    assert not moved[: 30 - 7].any()
    assert not moved[30 + 8 :].any()
    assert moved[30]
    x = sequence(convolution.BLOCK + 100).inputs.astype(np.float32)
    border = slice(convolution.BLOCK - 40, convolution.BLOCK + 40)
    alone = network(x[border.start - 7 : border.stop + 7])[7:-7]
    np.testing.assert_allclose(network(x)[border], alone, atol=1e-5)


def test_it_learns_what_depends_on_a_neighbour() -> None:
    errors, network = trained(
        convolution.make_network(3, 16, 2, (1, 1), 0), [sequence(seed=number) for number in range(8)], 150, 1e-2
    )
    assert np.mean(errors[-10:]) < 0.05 * np.mean(errors[:5])
    unseen = sequence(seed=99)
    assert np.corrcoef(network(unseen.inputs.astype(np.float32))[:, 0], unseen.targets[:, 0])[0, 1] > 0.97


def test_steps_that_do_not_count_are_not_learned() -> None:
    x, y, valid = sequence()
    broken = y.copy()
    broken[10:20] = 1e3
    valid = valid.copy()
    valid[10:20] = False
    network = convolution.make_network(3, 5, 2, (1,), seed=1)
    weights = np.full(2, 0.5, np.float32)
    good, _ = network_training._differentiate(network, [TrainingSequence(x, y, valid)], weights, 0.0, 0)
    bad, _ = network_training._differentiate(network, [TrainingSequence(x, broken, valid)], weights, 0.0, 0)
    assert bad == pytest.approx(good)
