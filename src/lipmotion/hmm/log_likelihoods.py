"""What a recording says about the states of unit models."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.model import UnitHmm

LOUD_SILENCE = 8.0
"""What the log density of silence loses in a loud frame."""
QUIET_SPEECH = 1000.0
"""What the log densities of all else lose in a quiet one."""

DensitySelection = NDArray[np.intp] | None
"""The densities wanted; None: all."""


@dataclass(frozen=True, eq=False)
class LogLikelihoods:
    """Log densities, computed when they are asked for: those of an hour do not fit into the memory.

    frames      : T
    log_density : (first frame, end, densities) -> [shape=(end - first, G')]
    """

    frames: int
    log_density: Callable[[int, int, DensitySelection], NDArray[np.float32]]


def log_likelihoods_of(hmm: UnitHmm, features: NDArray[np.float32]) -> LogLikelihoods:
    """Return what features [shape=(T, D)] say to the models they were made for."""
    return LogLikelihoods(
        len(features), lambda first, end, chosen: hmm.mixtures.log_likelihood(features[first:end], chosen)
    )


def penalise_silence(hmm: UnitHmm, evidence: LogLikelihoods, loud: NDArray[np.bool_]) -> LogLikelihoods:
    """Return evidence that makes silence improbable in loud frames [shape=(T,)], for forced alignment.

    A voice that the models do not know is, to them, hardly more like speech than like silence; its energy says which.
    """
    return _without(evidence, loud, _silent_densities(hmm), LOUD_SILENCE)


def penalise_speech(hmm: UnitHmm, evidence: LogLikelihoods, quiet: NDArray[np.bool_]) -> LogLikelihoods:
    """Return evidence that makes all but silence improbable in quiet frames [shape=(T,)]."""
    return _without(evidence, quiet, ~_silent_densities(hmm), QUIET_SPEECH)


def _silent_densities(hmm: UnitHmm) -> NDArray[np.bool_]:
    free = [hmm.table.density(unit, state) for unit in hmm.table.free for state in range(hmm.table.count(unit))]
    return np.isin(np.arange(len(hmm.table.names)), free)


def _without(
    evidence: LogLikelihoods, frames: NDArray[np.bool_], densities: NDArray[np.bool_], loss: float
) -> LogLikelihoods:
    """Return evidence in which some densities lose something in some frames."""

    def log_density(first: int, end: int, chosen: DensitySelection) -> NDArray[np.float32]:
        values = evidence.log_density(first, end, chosen)
        lost = densities if chosen is None else densities[chosen]
        values[np.ix_(frames[first:end], lost)] -= loss
        return values

    return LogLikelihoods(evidence.frames, log_density)
