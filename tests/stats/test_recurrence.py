import numpy as np
import pytest

from lipmotion.stats import network_training, recurrence
from oracles.recurrence import recurrent_outputs
from stats.networks import slopes, trained


def sequence(length: int = 30, seed: int = 0) -> network_training.TrainingSequence:
    """A sequence whose targets are the inputs a step before and a step after."""
    x = np.random.default_rng(seed).standard_normal((length, 2)).astype(np.float32)
    y = np.zeros((length, 2), np.float32)
    y[1:, 0], y[:-1, 1] = x[:-1, 0], x[1:, 1]
    return network_training.TrainingSequence(x, y, np.ones(length, bool))


@pytest.mark.parametrize("length", [7, 4300])
def test_it_is_what_its_equations_say_also_where_it_is_computed_in_pieces(length: int) -> None:
    network, x = recurrence.make_recurrent_network(2, 4, 3, 2, seed=0), sequence(length).inputs.astype(np.float32)
    np.testing.assert_allclose(network(x), recurrent_outputs(network, x), atol=1e-5 if length < 9 else 1e-3)
    assert network(x[:0]).shape == (0, 3)


def test_gradients_are_those_of_differences() -> None:
    network = recurrence.make_recurrent_network(2, 4, 2, 2, seed=1)
    gradients, differences = slopes(network, network.parameters, [sequence(9), sequence(6, 1)], 5e-3)
    assert differences == pytest.approx(gradients, abs=1e-3)


def test_dropped_units_have_no_gradient() -> None:
    network, weights = recurrence.make_recurrent_network(2, 4, 2, 2, seed=1), np.ones(2, np.float32)
    _, gradients = network_training._differentiate(network, [sequence(9)], weights, 1 - 1e-6, 0)
    assert not any(gradient.any() for gradient in gradients[:-1])
    assert gradients[-1].any()


def test_what_follows_the_end_of_a_shorter_sequence_counts_nothing() -> None:
    network, x = recurrence.make_recurrent_network(2, 4, 2, 2, seed=0), sequence(9).inputs.astype(np.float32)
    inside = np.array([[True] * 9, [True] * 6 + [False] * 3])
    together, _ = network.forward(np.stack([x, x]), inside, None)
    np.testing.assert_allclose(together[1, :6], network.hidden(x[:6]), atol=1e-6)


def train() -> tuple[list[float], recurrence.RecurrentNetwork]:
    network = recurrence.make_recurrent_network(2, 12, 2, 1, seed=0)
    return trained(network, [sequence(seed=number) for number in range(8)], 60, 5e-2)


def test_it_learns_what_it_must_remember_in_both_directions_and_always_the_same() -> None:
    errors, network = train()
    assert np.mean(errors[-10:]) < 0.1 * np.mean(errors[:5])
    unseen = sequence(seed=99)
    made = network(unseen.inputs.astype(np.float32))
    assert all(np.corrcoef(made[:, each], unseen.targets[:, each])[0, 1] > 0.9 for each in range(2))
    assert train()[0][:5] == pytest.approx(errors[:5])
