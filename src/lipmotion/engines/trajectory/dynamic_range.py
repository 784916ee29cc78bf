"""Movements as large as the original's: parameter generation alone makes them smaller."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.emission import Emission
from lipmotion.engines.trajectory.learning import Learning, Observed, rows_of
from lipmotion.kernels.banded import generate

Array = NDArray[np.float64]
LARGEST = 2.0
"""A dimension that hardly follows speech is not blown up further."""
LEAST_DEVIATION = 1e-6


def fit_gain(emission: Emission, observed: Sequence[Observed], how: Learning) -> Array:
    """Return by how much movements away from rest must grow, dimension by dimension [shape=(Q,)].

    The standard deviation within a clip, averaged over clips, of the original over that of what is generated.
    Source: Silén, Helander, Nurminen & Gabbouj 2012 (variance scaling); here about the rest pose, not the mean, so
    that a closed mouth stays closed.
    """
    original, generated = [], []
    for one in observed:
        if len(one.frames) < 2:
            continue
        means, precisions = emission.statistics(rows_of(emission, one.places, how.cut), one.features, slice(None))
        original.append(one.rows[:, 0].std(axis=0))
        generated.append(generate(means, precisions)[0][one.frames].std(axis=0))
    if not original:
        return np.ones(emission.means.shape[2])
    ratio = np.mean(original, axis=0) / np.maximum(np.mean(generated, axis=0), LEAST_DEVIATION)
    return np.clip(ratio, 1.0, LARGEST)


def widened(means: Array, precisions: Array, gain: Array, rest: Array) -> tuple[Array, Array]:
    """Return statistics of movements away from rest that are larger by ``gain``.

    means, precisions : [shape=(T, 3, Q)];  gain, rest : [shape=(Q,)]
    """
    grown = means * gain
    grown[:, 0] += rest * (1 - gain)
    return grown, precisions / (gain * gain)
