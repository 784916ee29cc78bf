"""Forced alignment: which state of which unit holds in every frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError, InputError
from lipmotion.hmm.log_likelihoods import LogLikelihoods
from lipmotion.hmm.multistream.inventory import States, states_of
from lipmotion.hmm.multistream.model import JointHmm
from lipmotion.hmm.multistream.streams import Observed, StreamWeights
from lipmotion.hmm.network import NetworkBuilder
from lipmotion.kernels.durations import best_durations

LONGEST = 60
"""Frames up to which the length of a state has a probability of its own."""
LEAST_SPREAD = 1.0
"""Least variance of a duration, in frames²: states that always lasted as long may still last a frame longer."""


@dataclass(frozen=True, eq=False)
class StatePath:
    """The state that holds in every frame.

    states : of the sequence of units
    frames : [shape=(T,)], which of them
    """

    states: States
    frames: NDArray[np.intp]

    def bounds(self, units: int) -> NDArray[np.intp]:
        """Return the first frame of each of so many units, and the frame count at the end."""
        positions = self.states.positions[self.frames]
        return np.append(np.searchsorted(positions, np.arange(units)), len(positions))


def align(
    hmm: JointHmm,
    observed: Observed,
    units: Sequence[str],
    bounds: NDArray[np.intp] | None = None,
    weights: StreamWeights | None = None,
) -> StatePath:
    """Return the most probable states of a sequence of units.

    bounds  : the first frame of each unit, and the frame count at the end, where they are known: only the states inside
              each unit are sought then; a unit with fewer frames than states has some of its states, spread evenly
    weights : of the streams; those of recognition by default
    Raises AlignmentError: fewer frames than states. Raises InputError: an unknown unit, or bounds that do not fit.
    """
    weights = weights or hmm.config.recognition
    states = states_of(hmm.inventory, units)
    inside = hmm.inside(observed, weights)
    log_density = hmm.log_density(inside, hmm.leaves(states.places), weights)
    kept = np.arange(len(states.rows))
    if bounds is not None:
        _check_bounds(bounds, len(units), observed.frames)
        kept = _kept(states, np.diff(bounds))
        first, end = bounds[states.positions], bounds[states.positions + 1]
        time = np.arange(observed.frames)[:, None]
        log_density[(time < first) | (time >= end)] = -np.inf
    _check_room(len(units), len(kept), observed.frames)
    return StatePath(states, kept[_best_path(hmm, log_density[:, kept], states.rows[kept])])


def _check_room(units: int, states: int, frames: int) -> None:
    if states > frames:
        raise AlignmentError(
            f"{units} units take at least {states} frames of 10 ms, found {frames}: the recording is too short for "
            "what should be said in it; give its own units"
        )


def _check_bounds(bounds: NDArray[np.intp], units: int, frames: int) -> None:
    if bounds.shape != (units + 1,) or bounds[0] != 0 or bounds[-1] != frames or (np.diff(bounds) < 0).any():
        raise InputError(f"bounds {bounds.tolist()} of {units} units; required one more than units, from 0 to {frames}")


def _kept(states: States, lengths: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the states that there is room for: of a unit that is too short, as many as it has frames."""
    kept = []
    for position, length in enumerate(lengths.tolist()):
        mine = np.flatnonzero(states.positions == position)
        count = min(length, len(mine))
        kept.append(mine[(2 * np.arange(count) + 1) * len(mine) // (2 * max(count, 1))])
    return np.concatenate(kept)


def _best_path(hmm: JointHmm, log_density: NDArray[np.float64], rows: NDArray[np.intp]) -> NDArray[np.intp]:
    builder = NetworkBuilder()
    for number, (stay, move) in enumerate(zip(hmm.log_stay[rows], hmm.log_move[rows], strict=True)):
        builder.state(number, float(stay))
        if number + 1 < len(rows):
            builder.arc(number, number + 1, float(move))
        else:
            builder.final(number, float(move))
    builder.initial(0)
    values = log_density.astype(np.float32)
    evidence = LogLikelihoods(len(values), lambda first, end, _: values[first:end])
    return builder.build().best_path(evidence)


def measured_durations(hmm: JointHmm, utterances: Iterable[tuple[Observed, Sequence[str]]]) -> NDArray[np.float64]:
    """Return mean and variance of the frames that each state without context lasts [shape=(R, 2)].

    Utterances without room for their units, or without a stream that is switched on in training, are left out. A state
    that was never heard lasts as its probability to be kept says.
    """
    sums = np.zeros((len(hmm.log_stay), 3))
    for observed, units in utterances:
        heard = set(hmm.config.training.on) & set(observed.streams) & set(hmm.parts)
        if not heard or len(states_of(hmm.inventory, units).rows) > observed.frames:
            continue
        path = align(hmm, observed, units, weights=hmm.config.training)
        frames = np.bincount(path.frames, minlength=len(path.states.rows)).astype(float)
        np.add.at(sums, path.states.rows, np.stack([np.ones(len(frames)), frames, frames * frames], axis=1))
    leave = np.exp(hmm.log_move)
    expected = np.stack([1 / leave, (1 - leave) / leave**2], axis=1)
    count = np.maximum(sums[:, 0], 1)
    mean = sums[:, 1] / count
    found = np.stack([mean, sums[:, 2] / count - mean * mean], axis=1)
    durations = np.where(sums[:, :1] > 0, found, expected)
    durations[:, 1] = np.maximum(durations[:, 1], LEAST_SPREAD)
    return durations


def align_by_durations(
    hmm: JointHmm,
    observed: Observed,
    units: Sequence[str],
    weight: float = 1.0,
    weights: StreamWeights | None = None,
) -> StatePath:
    """Return the most probable states of a sequence of units, each state's length as probable as it was in training.

    weight  : of the log probability of a length: a Gaussian of the state's measured mean and variance; beyond
              ``LONGEST`` frames, and in silence, the model's own geometric one
    weights : as in ``align``
    Raises as ``align``.
    """
    weights = weights or hmm.config.recognition
    states = states_of(hmm.inventory, units)
    log_density = hmm.log_density(hmm.inside(observed, weights), hmm.leaves(states.places), weights)
    log_duration = weight * _log_durations(hmm)[states.rows]
    _check_room(len(units), len(states.rows), observed.frames)
    lengths, _ = best_durations(log_density, log_duration, weight * hmm.log_stay[states.rows])
    return StatePath(states, np.repeat(np.arange(len(lengths)), lengths))


def _log_durations(hmm: JointHmm) -> NDArray[np.float64]:
    """Return the log probability of every state lasting 1 to ``LONGEST`` frames [shape=(R, LONGEST)]."""
    frames = np.arange(1, LONGEST + 1)
    mean, variance = hmm.durations[:, :1], hmm.durations[:, 1:]
    gaussian = -0.5 * ((frames - mean) ** 2 / variance)
    gaussian -= np.logaddexp.reduce(gaussian, axis=1)[:, None]
    geometric = (frames - 1) * hmm.log_stay[:, None] + hmm.log_move[:, None]
    silent = np.array([unit in hmm.inventory.free for unit, _ in hmm.inventory.rows])[:, None]
    return np.where(silent, geometric, gaussian)
