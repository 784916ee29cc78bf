"""Log likelihoods of recordings under the densities of unit models."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.model import UnitHmm

LOUD_SILENCE_PENALTY = 8.0
"""Penalty of silence in a loud frame, subtracted from its log density."""
QUIET_SPEECH_PENALTY = 1000.0
"""Penalty of everything but silence in a quiet frame."""

DensitySelection = NDArray[np.intp] | None
"""The numbers of the densities to compute; None: all."""


@dataclass(frozen=True, eq=False)
class LogLikelihoods:
    """Log densities of the frames of a recording, computed on demand: those of an hour do not fit into the memory.

    frames      : T
    log_density : (first frame, end, densities) -> [shape=(end - first, G')]
    """

    frames: int
    log_density: Callable[[int, int, DensitySelection], NDArray[np.float32]]

    def stretch(self, first: int, end: int) -> NDArray[np.float32]:
        """Return the log densities of some frames under all densities [shape=(end - first, G)]."""
        return self.log_density(first, end, None)


def wrap_log_likelihoods(values: NDArray[np.float32]) -> LogLikelihoods:
    """Return the log likelihoods of a recording, or a stretch of one, that were computed [shape=(T, G)]."""

    def log_density(first: int, end: int, chosen: DensitySelection) -> NDArray[np.float32]:
        return values[first:end].copy() if chosen is None else values[first:end][:, chosen]

    return LogLikelihoods(len(values), log_density)


def compute_log_likelihoods(hmm: UnitHmm, features: NDArray[np.float32]) -> LogLikelihoods:
    """Return the log likelihoods of features [shape=(T, D)] under models of the same features."""
    return LogLikelihoods(
        len(features), lambda first, end, chosen: hmm.mixtures.log_likelihood(features[first:end], chosen)
    )


def penalise_silence(hmm: UnitHmm, log_likelihoods: LogLikelihoods, loud: NDArray[np.bool_]) -> LogLikelihoods:
    """Return log likelihoods that make silence improbable in loud frames [shape=(T,)], for forced alignment."""
    return _penalise(hmm, log_likelihoods, loud, LOUD_SILENCE_PENALTY, silent=True)


def penalise_speech(hmm: UnitHmm, log_likelihoods: LogLikelihoods, quiet: NDArray[np.bool_]) -> LogLikelihoods:
    """Return log likelihoods that make all but silence improbable in quiet frames [shape=(T,)]."""
    return _penalise(hmm, log_likelihoods, quiet, QUIET_SPEECH_PENALTY, silent=False)


def _penalise(
    hmm: UnitHmm, log_likelihoods: LogLikelihoods, frames: NDArray[np.bool_], penalty: float, *, silent: bool
) -> LogLikelihoods:
    """Return log likelihoods reduced by a penalty in some frames, of the densities that are of silence or are not."""
    free = [hmm.table.density(unit, state) for unit in hmm.table.free for state in range(hmm.table.count(unit))]
    penalised = np.isin(np.arange(len(hmm.table.names)), free) == silent

    def log_density(first: int, end: int, chosen: DensitySelection) -> NDArray[np.float32]:
        values = log_likelihoods.log_density(first, end, chosen)
        values[np.ix_(frames[first:end], penalised if chosen is None else penalised[chosen])] -= penalty
        return values

    return LogLikelihoods(log_likelihoods.frames, log_density)
