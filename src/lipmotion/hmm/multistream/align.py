"""Forced alignment of unit sequences, and the durations of states measured in alignments."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError, InputError
from lipmotion.hmm.multistream.model import JointHmm
from lipmotion.hmm.multistream.streams import StreamObservations, StreamWeights
from lipmotion.hmm.multistream.unit_states import TriphoneStates, expand_triphones
from lipmotion.hmm.network import LogLikelihoods, build_chain

MIN_VARIANCE = 1.0
"""Smallest variance of a duration, in frames²; durations that were all equal have variance 0."""


@dataclass(frozen=True, eq=False)
class StatePath:
    """The states of a sequence of units, and which of them each frame has [shape=(T,)]."""

    states: TriphoneStates
    frames: NDArray[np.intp]

    def bounds(self, units: int) -> NDArray[np.intp]:
        """Return the first frame of each of so many units, and the frame count at the end."""
        positions = self.states.positions[self.frames]
        return np.append(np.searchsorted(positions, np.arange(units)), len(positions))


def align(
    hmm: JointHmm,
    observed: StreamObservations,
    units: Sequence[str],
    bounds: NDArray[np.intp] | None = None,
    weights: StreamWeights | None = None,
) -> StatePath:
    """Return the most probable path through the states of a sequence of units.

    bounds  : the first frame of each unit, and the frame count at the end, where they are known: then only the path
              inside each unit is searched; a unit with fewer frames than states has some of its states, evenly spread
    weights : of the streams; those of recognition by default
    Raises AlignmentError: fewer frames than states. Raises InputError: an unknown unit, or bounds that do not fit.
    """
    weights = weights or hmm.config.recognition
    states = expand_triphones(hmm.inventory, units)
    streams = hmm.standardise(observed, weights)
    log_density = hmm.log_density(streams, hmm.leaves(states.triphones), weights)
    chosen = np.arange(len(states.monophones))
    if bounds is not None:
        check_bounds(bounds, len(units), observed.frames)
        first, end = bounds[states.positions], bounds[states.positions + 1]
        time = np.arange(observed.frames)[:, None]
        log_density[(time < first) | (time >= end)] = -np.inf
        fitting = []  # of a unit with fewer frames than states, one state for each frame
        for position, length in enumerate(np.diff(bounds).tolist()):
            of_unit = np.flatnonzero(states.positions == position)
            count = min(length, len(of_unit))
            fitting.append(of_unit[(2 * np.arange(count) + 1) * len(of_unit) // (2 * max(count, 1))])
        chosen = np.concatenate(fitting)
    if len(chosen) > observed.frames:
        raise AlignmentError(
            f"{len(units)} units take at least {len(chosen)} frames of 10 ms, found {observed.frames}: the recording "
            "is too short for what should be said in it; give its own units"
        )
    monophones = states.monophones[chosen]
    network = build_chain(range(len(chosen)), hmm.log_stay[monophones], hmm.log_move[monophones])
    values = log_density[:, chosen].astype(np.float32)
    path = network.best_path(LogLikelihoods(len(values), lambda first, end, _: values[first:end]))
    return StatePath(states, chosen[path])


def check_bounds(bounds: NDArray[np.intp], units: int, frames: int) -> None:
    """Raise InputError unless bounds are the first frames of so many units, and the frame count at the end."""
    if bounds.shape != (units + 1,) or bounds[0] != 0 or bounds[-1] != frames or (np.diff(bounds) < 0).any():
        raise InputError(f"bounds {bounds.tolist()} of {units} units; required one more than units, from 0 to {frames}")


def measure_durations(
    hmm: JointHmm, utterances: Iterable[tuple[StreamObservations, Sequence[str]]]
) -> NDArray[np.float64]:
    """Return mean and variance of the duration of each state without context, in frames [shape=(R, 2)]."""
    sums = np.zeros((len(hmm.log_stay), 3))
    for observed, units in utterances:
        active = set(hmm.config.training.active) & set(observed.streams) & set(hmm.models)
        if not active or len(expand_triphones(hmm.inventory, units).monophones) > observed.frames:
            continue
        path = align(hmm, observed, units, weights=hmm.config.training)
        frames = np.bincount(path.frames, minlength=len(path.states.monophones)).astype(float)
        np.add.at(sums, path.states.monophones, np.stack([np.ones(len(frames)), frames, frames * frames], axis=1))
    leave = np.exp(hmm.log_move)
    geometric = np.stack([1 / leave, (1 - leave) / leave**2], axis=1)
    count = np.maximum(sums[:, 0], 1)
    mean = sums[:, 1] / count
    measured = np.stack([mean, sums[:, 2] / count - mean * mean], axis=1)
    durations = np.where(sums[:, :1] > 0, measured, geometric)
    durations[:, 1] = np.maximum(durations[:, 1], MIN_VARIANCE)
    return durations
