"""Inference with multi-stream models: alignment, recognition of the most probable units, and generation of motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError
from lipmotion.hmm.multistream.densities import ACOUSTIC_STREAMS, MOTION, StreamObservations, StreamWeights
from lipmotion.hmm.multistream.model import JointHmm
from lipmotion.hmm.multistream.unit_states import TriphoneStates, expand_triphones
from lipmotion.hmm.network import LogLikelihoods, UnitLoop, build_chain, build_loop, decode_path, score_language
from lipmotion.kernels.banded import solve_mlpg
from lipmotion.stats.curves import with_dynamics


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
    Raises AlignmentError: fewer frames than states. Raises InputError: an unknown unit.
    """
    weights = weights or hmm.config.recognition
    states = expand_triphones(hmm.inventory, units)
    streams = hmm.standardise(observed, weights)
    log_density = hmm.log_density(streams, hmm.leaves(states.triphones), weights)
    chosen = np.arange(len(states.monophones))
    if bounds is not None:
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
            f"{len(units)} units take at least {len(chosen)} frames of 10 ms, found {observed.frames}; give its units"
        )
    monophones = states.monophones[chosen]
    network = build_chain(range(len(chosen)), hmm.log_stay[monophones], hmm.log_move[monophones])
    values = log_density[:, chosen].astype(np.float32)
    path = network.best_path(LogLikelihoods(len(values), lambda first, end, _: values[first:end]))
    return StatePath(states, chosen[path])


@lru_cache(maxsize=4)
def build_context_loop(hmm: JointHmm) -> tuple[UnitLoop, dict[str, NDArray[np.intp]]]:
    """Return the loop of the units spoken in training with the back-off bigram (Hofer 2008, Eq. 5), in context.

    Beside it, by acoustic stream, the leaves of each of its distinct densities [shape=(C,)]. A few loops are cached.
    """
    inventory, config = hmm.inventory, hmm.config
    units = [unit for unit in hmm.spoken if unit not in inventory.free[1:]]
    acoustic = [name for name in ACOUSTIC_STREAMS if name in hmm.models]
    counts = [inventory.count(unit) for unit in units]
    grids = np.stack(
        [
            np.stack([hmm.models[name].forest.leaf_grid(unit, state, units) for name in acoustic], axis=-1)
            for unit, count in zip(units, counts, strict=True)
            for state in range(count)
        ]
    )
    distinct, number = np.unique(grids.reshape(-1, len(acoustic)), axis=0, return_inverse=True)
    of_states = np.split(number.reshape(grids.shape[:-1]), np.cumsum(counts)[:-1])
    log_stay = {
        unit: [float(hmm.log_stay[inventory.monophones[unit, state]]) for state in range(count)]
        for unit, count in zip(units, counts, strict=True)
    }
    language = score_language(hmm.bigram, config.bigram_weight, config.insertion)
    loop = build_loop(dict(zip(units, of_states, strict=True)), log_stay, inventory.silence, language, config.insertion)
    return loop, dict(zip(acoustic, distinct.T, strict=True))


def recognise_units(hmm: JointHmm, observed: StreamObservations) -> tuple[tuple[str, ...], NDArray[np.intp]]:
    """Return the likeliest of all sequences of units that occurred in training, in context, with the back-off bigram.

    With it the first frame of each unit, and the frame count at the end.
    The search is exact, however many neighbours trees ask about. A unit of one state, spoken twice, is recognised once.
    Raises InputError: no active stream. Raises AlignmentError: too few frames.
    Source: Hofer 2008, Eq. 5.
    """
    weights, (loop, leaves) = hmm.config.recognition, build_context_loop(hmm)
    streams = hmm.standardise(observed, weights)

    def log_density(first: int, end: int, _: NDArray[np.intp] | None) -> NDArray[np.float32]:
        rows = {name: stream[first:end] for name, stream in streams.items()}
        return hmm.log_density(rows, leaves, weights).astype(np.float32)

    return decode_path(loop, loop.network.best_path(LogLikelihoods(observed.frames, log_density)))


Array = NDArray[np.float64]
ITERATIONS = 20  # largest number of steps of EM; a dozen are enough nearly always
MIN_GAIN = 1e-4  # EM ends when a step raises the log likelihood per frame by less
LOG_2PI = float(np.log(2 * np.pi))


@dataclass(frozen=True, eq=False)
class FrameDensities:
    """A mixture of M diagonal Gaussians for every frame, of static values, Δ and Δ².

    log_weights : [shape=(T, M)]
    means, precisions : [shape=(T, M, 3, Q)], in units of the motion
    Δ and Δ² of the first and last frame, which need frames outside, have precision 0.
    """

    log_weights: Array
    means: Array
    precisions: Array

    def log_components(self, trajectory: Array) -> Array:
        """Return log weight + log density of a trajectory [shape=(T, Q)] and its dynamics [shape=(T, M)]."""
        off = with_dynamics(trajectory)[:, None] - self.means
        used = self.precisions > 0
        scale = np.log(np.where(used, self.precisions, 1)) - LOG_2PI * used
        return self.log_weights + 0.5 * (scale - self.precisions * off * off).sum(axis=(2, 3))


def select_densities(hmm: JointHmm, path: StatePath) -> FrameDensities:
    """Return the densities of motion along a path of states."""
    model = hmm.models[MOTION]
    mixtures, deviation = model.tied.mixtures, model.scale.deviation
    G, M, D = mixtures.size
    means = (mixtures.means * deviation + model.scale.mean).reshape(G, M, 3, D // 3)
    precisions = (1 / (mixtures.variances * deviation**2)).reshape(G, M, 3, D // 3)
    chosen = model.forest.leaves(path.states.triphones)[path.frames]
    precisions = precisions[chosen]
    precisions[[0, -1], :, 1:] = 0  # Δ and Δ² of the first and last frame count for nothing
    return FrameDensities(mixtures.log_weights[chosen].astype(float), means[chosen], precisions)


def solve_trajectory(densities: FrameDensities, iterations: int = ITERATIONS) -> tuple[Array, tuple[float, ...]]:
    """Return the trajectory that is most probable together with its dynamics, and its log likelihood by step.

    iterations : most steps of EM over the Gaussians of mixtures; for single ones there is a closed form
    Source: Hofer 2008, Eqs. 6–11, with Δ²x_t = x_{t−1} − 2x_t + x_{t+1} (the print lost the minus sign); for mixtures,
    EM over the components as in Tokuda et al. 2000, case 3 with one state path.
    Cost: O(T·M·Q) a step.
    """
    values, _ = solve_mlpg(*_merge(densities, np.exp(densities.log_weights)))
    log_likelihoods: list[float] = []
    for _ in range(iterations):
        components = densities.log_components(values)
        best = components.max(axis=1, keepdims=True)
        share = np.exp(components - best)
        log_likelihoods.append(float((best[:, 0] + np.log(share.sum(axis=1))).sum()))
        gain = np.diff(log_likelihoods[-2:])
        if share.shape[1] == 1 or len(log_likelihoods) == iterations or (gain < MIN_GAIN * len(values)).any():
            break
        values, _ = solve_mlpg(*_merge(densities, share / share.sum(axis=1, keepdims=True)))
    return values, tuple(log_likelihoods)


def merge_gaussians(densities: FrameDensities) -> tuple[Array, Array]:
    """Return one Gaussian for every frame: mean and precision [each shape=(T, 3, Q)]."""
    if densities.log_weights.shape[1] == 1:
        return densities.means[:, 0], densities.precisions[:, 0]
    components = densities.log_components(solve_trajectory(densities)[0])
    share = np.exp(components - components.max(axis=1, keepdims=True))
    return _merge(densities, share / share.sum(axis=1, keepdims=True))


def _merge(densities: FrameDensities, share: Array) -> tuple[Array, Array]:
    """Return mean and precision of every frame [each shape=(T, 3, Q)], given posteriors of the Gaussians (T, M)."""
    shared = densities.precisions * share[:, :, None, None]
    precision = shared.sum(axis=1)
    return (shared * densities.means).sum(axis=1) / np.maximum(precision, np.finfo(float).tiny), precision
