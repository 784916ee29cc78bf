"""What the tests of both kinds of networks share: slopes by differences, and a short training."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.stats import network_training
from lipmotion.stats.network_training import TrainingPlan, TrainingSequence, fit_network


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
