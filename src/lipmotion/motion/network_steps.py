"""Time steps of networks, of 40 ms, and the frames of 10 ms between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.stats.convolution import TrainingSequence

Array = NDArray[np.float64]
STEP = 4
"""Frames of a time step, 40 ms: about a picture of a video."""
DIRECT_WEIGHT = 4.0
"""Weight, in training, of the error of a channel that is modelled as it is; that of a principal component is 1."""
LEAST_DEVIATION = 1e-6
LONGEST_STEPS = 250
"""Longer recordings are cut into pieces of so many time steps, 10 s, for training."""


def between_steps(steps: Array, frames: int) -> Array:
    """Return values at time steps of 40 ms [shape=(N, C)] interpolated to frames of 10 ms [shape=(frames, C)].

    Source: Catmull & Rom 1974; the curve has no corners, and passes through the values.
    """
    padded = np.concatenate([steps[:1], steps, steps[-1:], steps[-1:]])
    position, u = np.divmod(np.arange(frames), STEP)
    u = (u / STEP)[:, None]
    before, here, after, last = (padded[np.minimum(position + k, len(padded) - 1)] for k in range(4))
    return here + u / 2 * (
        after - before + u * (2 * before - 5 * here + 4 * after - last + u * (3 * (here - after) + last - before))
    )


def random_piece(sequence: TrainingSequence, rng: np.random.Generator) -> TrainingSequence:
    """Return a sequence, or a piece of it from a random place where it is long."""
    excess = len(sequence.inputs) - LONGEST_STEPS
    if excess <= 0:
        return sequence
    start = int(rng.integers(excess + 1))
    kept = slice(start, start + LONGEST_STEPS)
    return TrainingSequence(sequence.inputs[kept], sequence.targets[kept], sequence.valid[kept])
