"""Inference with multi-stream models: alignment, recognition of the most probable units, and generation of motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError
from lipmotion.hmm.multistream.densities import ACOUSTIC_STREAMS, MOTION, StreamObservations, StreamWeights
from lipmotion.hmm.multistream.model import JointHmm
from lipmotion.hmm.multistream.unit_states import RecognisedUnit, TriphoneStates, expand_triphones
from lipmotion.hmm.network import LogLikelihoods, NetworkBuilder, UnitLoop, build_chain, decode_path
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
            f"{len(units)} units take at least {len(chosen)} frames of 10 ms, found {observed.frames}: the recording "
            "is too short for what should be said in it; give its own units"
        )
    monophones = states.monophones[chosen]
    network = build_chain(range(len(chosen)), hmm.log_stay[monophones], hmm.log_move[monophones])
    values = log_density[:, chosen].astype(np.float32)
    path = network.best_path(LogLikelihoods(len(values), lambda first, end, _: values[first:end]))
    return StatePath(states, chosen[path])


Grid = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class ContextLoop:
    """The network in which every unit that was spoken in training may follow every other, in context.

    leaves     : by acoustic stream, the leaves of each distinct density [shape=(C,)]
    monophones : [shape=(nodes,)], the number of each node's state without context
    """

    network: UnitLoop
    leaves: dict[str, NDArray[np.intp]]
    monophones: NDArray[np.intp]


class _StateNodes(NamedTuple):
    """The nodes of one state of a unit: one for each class of left and each of right neighbours that it tells apart.

    left, right : [shape=(N,)], the class of every neighbour
    numbers     : of the nodes [shape=(classes, classes)]

    A node stands for what the states from it on make of the left neighbour, and what the states up to it made of the
    right one: neighbours that these do not tell apart share it. So the search is exact with the fewest nodes.
    """

    left: NDArray[np.intp]
    right: NDArray[np.intp]
    numbers: Grid


@lru_cache(maxsize=4)
def build_context_loop(hmm: JointHmm) -> ContextLoop:
    """Return the loop of a model's units with the back-off bigram (Hofer 2008, Eq. 5), as if silence were around it.

    The loops of the last few models are cached.
    """
    inventory = hmm.inventory
    units = [unit for unit in hmm.spoken if unit not in inventory.free[1:]]
    leaves, densities = _number_densities(hmm, units)
    builder, owners, monophones = NetworkBuilder(), list[str](), list[int]()
    nodes: dict[str, list[_StateNodes]] = {}
    for unit in units:
        nodes[unit] = []
        for state, grid in enumerate(densities[unit]):
            monophone = inventory.monophones[unit, state]
            left = _classify(densities[unit][state:].transpose(1, 0, 2))
            right = _classify(densities[unit][: state + 1].transpose(2, 0, 1))
            _, first_left = np.unique(left, return_index=True)
            _, first_right = np.unique(right, return_index=True)
            chosen = grid[np.ix_(first_left, first_right)]
            stay = float(hmm.log_stay[monophone])
            numbers = np.array([[builder.state(int(density), stay) for density in row] for row in chosen], np.intp)
            owners += [unit] * numbers.size
            monophones += [monophone] * numbers.size
            nodes[unit].append(_StateNodes(left, right, numbers))
        for state, (source, target) in enumerate(pairwise(nodes[unit])):
            _advance(builder, source, target, float(hmm.log_move[inventory.monophones[unit, state]]))
    _join_units(builder, hmm, units, nodes)
    entries = frozenset(int(number) for of_unit in nodes.values() for number in of_unit[0].numbers.ravel())
    network = UnitLoop(builder.build(), tuple(owners), entries)
    return ContextLoop(network, leaves, np.array(monophones, np.intp))


def _join_units(
    builder: NetworkBuilder, hmm: JointHmm, units: Sequence[str], nodes: Mapping[str, Sequence[_StateNodes]]
) -> None:
    """Join the last state of every unit to the first one of every unit, and let recordings begin and end."""
    place, silence = {unit: number for number, unit in enumerate(units)}, hmm.inventory.silence
    for unit in units:
        first, last = nodes[unit][0], nodes[unit][-1]
        leave = float(hmm.log_move[hmm.inventory.monophones[unit, hmm.inventory.count(unit) - 1]])
        for following in units:
            entered, score = nodes[following][0], leave + _language_score(hmm, unit, following)
            for source in last.numbers[:, last.right[place[following]]].tolist():
                for target in entered.numbers[entered.left[place[unit]]].tolist():
                    builder.arc(source, target, score)
        begin = hmm.config.insertion if unit == silence else _language_score(hmm, silence, unit)
        builder.initial.update(dict.fromkeys(first.numbers[first.left[place[silence]]].tolist(), begin))
        end = leave + (0.0 if unit == silence else _language_score(hmm, unit, silence))
        builder.final.update(dict.fromkeys(last.numbers[:, last.right[place[silence]]].tolist(), end))


def _language_score(hmm: JointHmm, unit: str, following: str) -> float:
    """Return the score of the language model: weighted log bigram plus insertion penalty."""
    return hmm.config.bigram_weight * hmm.bigram(unit, following) + hmm.config.insertion


def _number_densities(hmm: JointHmm, units: Sequence[str]) -> tuple[dict[str, NDArray[np.intp]], dict[str, Grid]]:
    """Return the leaves of distinct densities by stream, and by unit the density of each state beside N² neighbours."""
    acoustic = [name for name in ACOUSTIC_STREAMS if name in hmm.models]
    counts = [hmm.inventory.count(unit) for unit in units]
    grids = np.stack(
        [
            np.stack([hmm.models[name].forest.leaf_grid(unit, state, units) for name in acoustic], axis=-1)
            for unit, count in zip(units, counts, strict=True)
            for state in range(count)
        ]
    )
    distinct, number = np.unique(grids.reshape(-1, len(acoustic)), axis=0, return_inverse=True)
    of_states = np.split(number.reshape(grids.shape[:-1]), np.cumsum(counts)[:-1])
    return dict(zip(acoustic, distinct.T, strict=True)), dict(zip(units, of_states, strict=True))


def _classify(rows: Grid) -> NDArray[np.intp]:
    """Return the class of every row: those of equal rows are the same [shape=(N,)]."""
    return np.unique(rows.reshape(len(rows), -1), axis=0, return_inverse=True)[1].reshape(-1)


def _advance(builder: NetworkBuilder, source: _StateNodes, target: _StateNodes, log_move: float) -> None:
    """Join two successive states: left neighbours that the second tells apart, and right ones that the first did."""
    for left, left_after in set(zip(source.left.tolist(), target.left.tolist(), strict=True)):
        for right, right_after in set(zip(source.right.tolist(), target.right.tolist(), strict=True)):
            builder.arc(int(source.numbers[left, right]), int(target.numbers[left_after, right_after]), log_move)


def recognise_units(hmm: JointHmm, observed: StreamObservations) -> list[RecognisedUnit]:
    """Return the likeliest of all sequences of units that occurred in training, in context, with the back-off bigram.

    The search is exact, whether trees of acoustic streams ask about one neighbour or both. Where units have one state,
    a unit spoken twice in a row is recognised once.
    Raises InputError: no active stream. Raises AlignmentError: too few frames.
    Source: Hofer 2008, Eq. 5.
    """
    weights, context_loop = hmm.config.recognition, build_context_loop(hmm)
    streams = hmm.standardise(observed, weights)

    def log_density(first: int, end: int, _: NDArray[np.intp] | None) -> NDArray[np.float32]:
        rows = {name: stream[first:end] for name, stream in streams.items()}
        return hmm.log_density(rows, context_loop.leaves, weights).astype(np.float32)

    loop = context_loop.network
    units, starts = decode_path(loop, loop.network.best_path(LogLikelihoods(observed.frames, log_density)))
    return [RecognisedUnit(unit, int(first)) for unit, first in zip(units, starts[:-1], strict=True)]


Array = NDArray[np.float64]
ITERATIONS = 20
"""Largest number of steps of EM; a dozen are enough nearly always."""
MIN_GAIN = 1e-4
"""EM ends when a step raises the log likelihood per frame by less."""
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
