"""Networks of states, in which the best path is searched: recognition without a transcript.

Log densities of frames are computed on demand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError
from lipmotion.hmm.model import UnitHmm
from lipmotion.kernels.paths import NetworkArrays, Windows, best_path
from lipmotion.stats.bigram import Bigram

LOUD_SILENCE_PENALTY = 8.0  # penalty of silence in a loud frame, subtracted from its log density
QUIET_SPEECH_PENALTY = 1000.0  # penalty of everything but silence in a quiet frame

DensitySelection = NDArray[np.intp] | None  # the numbers of the densities to compute; None: all


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


def penalise(
    hmm: UnitHmm, log_likelihoods: LogLikelihoods, frames: NDArray[np.bool_], *, silent: bool
) -> LogLikelihoods:
    """Return log likelihoods that make silence improbable in loud frames, or all else in quiet frames [shape=(T,)]."""
    penalty = LOUD_SILENCE_PENALTY if silent else QUIET_SPEECH_PENALTY
    free = [hmm.table.density(unit, state) for unit in hmm.table.free for state in range(hmm.table.count(unit))]
    penalised = np.isin(np.arange(len(hmm.table.names)), free) == silent

    def log_density(first: int, end: int, chosen: DensitySelection) -> NDArray[np.float32]:
        values = log_likelihoods.log_density(first, end, chosen)
        values[np.ix_(frames[first:end], penalised if chosen is None else penalised[chosen])] -= penalty
        return values

    return LogLikelihoods(log_likelihoods.frames, log_density)


CACHED_FRAMES = 12_000
"""Log densities of up to so many frames (two minutes) are computed once and cached; those of more frames, twice."""


class Network(NetworkArrays):
    """States joined by arcs, in which the best path can be searched."""

    def best_path(
        self, log_likelihoods: LogLikelihoods, chosen: NDArray[np.intp] | None = None, windows: Windows | None = None
    ) -> NDArray[np.intp]:
        """Return the states of the best path [shape=(T,)].

        chosen  : the densities that ``emission`` numbers; None: all
        windows : the frames that each state may have; None: any
        Raises AlignmentError: no path reaches the end.
        """
        frames = log_likelihoods.frames
        cached = log_likelihoods.log_density(0, frames, chosen) if frames <= CACHED_FRAMES else None

        def log_emission(first: int, end: int) -> NDArray[np.float32]:
            return log_likelihoods.log_density(first, end, chosen) if cached is None else cached[first:end]

        path, score = best_path(log_emission, frames, self, windows)
        if not np.isfinite(score):
            raise AlignmentError(
                f"no path through {len(self.emission)} states in {frames} frames of 10 ms: the recording is too short"
            )
        return path


class NetworkBuilder:
    """Builder of a ``Network``, to which states and arcs are added in any order.

    initial, final : log probabilities of beginning and of ending in states
    """

    def __init__(self) -> None:
        self._emission: list[int] = []
        self._arcs: list[tuple[int, int, float]] = []
        self.initial: dict[int, float] = {}
        self.final: dict[int, float] = {}

    def state(self, density: int, stay: float) -> int:
        """Add a state with an arc to itself of log probability ``stay``; return its number."""
        number = len(self._emission)
        self._emission.append(density)
        self._arcs.append((number, number, stay))
        return number

    def arc(self, source: int, target: int, log_probability: float) -> None:
        """Add an arc between two states."""
        self._arcs.append((target, source, log_probability))

    def build(self) -> Network:
        """Return the network, with its arcs sorted by target."""
        arcs = sorted(self._arcs, key=lambda arc: arc[0])
        targets = np.array([arc[0] for arc in arcs], np.intp)
        count = len(self._emission)
        log_initial, log_final = np.full((2, count), -np.inf, np.float32)
        log_initial[[*self.initial]] = [*self.initial.values()]
        log_final[[*self.final]] = [*self.final.values()]
        return Network(
            emission=np.array(self._emission, np.intp),
            arc_from=np.array([arc[1] for arc in arcs], np.intp),
            arc_log=np.array([arc[2] for arc in arcs], np.float32),
            arc_start=np.searchsorted(targets, np.arange(count)).astype(np.intp),
            log_initial=log_initial,
            log_final=log_final,
        )


def build_chain(
    densities: Iterable[int], log_stay: NDArray[np.floating[Any]], log_move: NDArray[np.floating[Any]]
) -> Network:
    """Return the network of S states in a row, with log probabilities of staying and leaving [each shape=(S,)]."""
    builder = NetworkBuilder()
    for number, (density, stay) in enumerate(zip(densities, log_stay.tolist(), strict=True)):
        builder.state(int(density), stay)
        if number:
            builder.arc(number - 1, number, float(log_move[number - 1]))
    builder.initial[0] = 0.0
    builder.final[len(log_stay) - 1] = float(log_move[-1])
    return builder.build()


@dataclass(frozen=True, eq=False)
class UnitLoop:
    """The network of units that may all follow each other; the unit of each node, and the nodes of first states."""

    network: Network
    owners: tuple[str, ...]
    entries: frozenset[int]


class _StateNodes(NamedTuple):
    """The nodes of one state of a unit: one for each class of left and each of right neighbours that it tells apart.

    left, right : [shape=(N,)], the class of every neighbour
    numbers     : of the nodes [shape=(classes, classes)]

    A node stands for what the states from it on make of the left neighbour, and what the states up to it made of the
    right one: neighbours that these do not tell apart share it. So the search is exact with the fewest nodes.
    """

    left: NDArray[np.intp]
    right: NDArray[np.intp]
    numbers: NDArray[np.intp]


def build_loop(
    densities: Mapping[str, NDArray[np.intp]],
    log_stay: Mapping[str, Sequence[float]],
    silence: str,
    score: Callable[[str, str], float],
    insertion: float,
) -> UnitLoop:
    """Return the loop of N units. Recordings begin and end in silence, or in any unit as if it were beside.

    densities : by unit, those of its states beside every left and every right one of the units [shape=(states, N, N)]
    log_stay  : by unit, log P(stay in each of its states)
    score     : of the language model, for a unit and the one that follows
    insertion : score of the silence in which a recording begins
    """
    builder, owners, nodes = NetworkBuilder(), list[str](), dict[str, list[_StateNodes]]()
    place = {unit: number for number, unit in enumerate(densities)}
    leave = {unit: float(np.log(-np.expm1(stays[-1]))) for unit, stays in log_stay.items()}
    for unit, grids in densities.items():
        nodes[unit] = []
        for state, (grid, stay) in enumerate(zip(grids, log_stay[unit], strict=True)):
            left, right = _classify(grids[state:].transpose(1, 0, 2)), _classify(grids[: state + 1].transpose(2, 0, 1))
            firsts = (np.unique(classes, return_index=True)[1] for classes in (left, right))
            numbers = [[builder.state(int(density), stay) for density in row] for row in grid[np.ix_(*firsts)]]
            nodes[unit].append(_StateNodes(left, right, np.array(numbers, np.intp)))
            owners += [unit] * nodes[unit][-1].numbers.size
        for stay, (source, target) in zip(log_stay[unit], pairwise(nodes[unit]), strict=False):
            move = float(np.log(-np.expm1(stay)))
            for left, left_after in set(zip(source.left.tolist(), target.left.tolist(), strict=True)):
                for right, right_after in set(zip(source.right.tolist(), target.right.tolist(), strict=True)):
                    builder.arc(int(source.numbers[left, right]), int(target.numbers[left_after, right_after]), move)
    for unit in densities:
        first, last = nodes[unit][0], nodes[unit][-1]
        for following in densities:
            entered, arc_score = nodes[following][0], leave[unit] + score(unit, following)
            for source in last.numbers[:, last.right[place[following]]].tolist():
                for target in entered.numbers[entered.left[place[unit]]].tolist():
                    builder.arc(source, target, arc_score)
        begin = insertion if unit == silence else score(silence, unit)
        builder.initial.update(dict.fromkeys(first.numbers[first.left[place[silence]]].tolist(), begin))
        end = leave[unit] + (0.0 if unit == silence else score(unit, silence))
        builder.final.update(dict.fromkeys(last.numbers[:, last.right[place[silence]]].tolist(), end))
    entries = frozenset(int(number) for of_unit in nodes.values() for number in of_unit[0].numbers.ravel())
    return UnitLoop(builder.build(), tuple(owners), entries)


def _classify(rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the class of every row: those of equal rows are the same [shape=(N,)]."""
    classes = dict[bytes, int]()  # many times faster than ``np.unique`` of rows
    return np.array([classes.setdefault(row.tobytes(), len(classes)) for row in rows], np.intp)


def build_unit_loop(hmm: UnitHmm, inventory: Sequence[str]) -> UnitLoop:
    """Return the loop over an inventory, with the models' bigram (``build_loop``)."""
    table, config = hmm.table, hmm.config
    densities, log_stay = dict[str, NDArray[np.intp]](), dict[str, list[float]]()
    for unit in inventory:
        grids = []
        for state in range(table.count(unit)):
            row = np.array([table.density(unit, state, neighbour) for neighbour in inventory], np.intp)
            turned = row[:, None] if table.side(unit, state) == "<" else row
            grids.append(np.broadcast_to(turned, (len(inventory), len(inventory))))
        densities[unit] = np.stack(grids)
        log_stay[unit] = [hmm.stay(unit, state) for state in range(table.count(unit))]
    language = score_language(hmm.bigram, config.bigram_weight, config.insertion)
    return build_loop(densities, log_stay, table.free[0], language, config.insertion)


def score_language(bigram: Bigram, weight: float, insertion: float) -> Callable[[str, str], float]:
    """Return the score of the language model for a unit and the one after it: weighted log bigram plus insertion."""
    return lambda unit, following: weight * bigram(unit, following) + insertion


def decode_path(loop: UnitLoop, path: NDArray[np.intp]) -> tuple[tuple[str, ...], NDArray[np.intp]]:
    """Return the units of a path through the loop [shape=(T,)], their first frames, and the frame count at the end."""
    starts = [t for t in range(len(path)) if t == 0 or (path[t] != path[t - 1] and path[t] in loop.entries)]
    return tuple(loop.owners[path[t]] for t in starts), np.array([*starts, len(path)], np.intp)
