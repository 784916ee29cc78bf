"""Networks of states, in which the best path is searched: recognition without a transcript.

Log densities of frames are computed on demand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError
from lipmotion.hmm.model import Neighbour, StateTable, UnitHmm
from lipmotion.kernels.paths import NetworkArrays, Windows, best_path

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
                f"no path through {len(self.emission)} states in {frames} frames of 10 ms: "
                "the recording is too short for what should be said in it"
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


StateNodes = dict[Neighbour, int]
"""The nodes of one state of a unit: by neighbour, and under None the node for all other neighbours."""


@dataclass(frozen=True, eq=False)
class UnitLoop:
    """The network of units that may all follow each other; the unit of each node, and the nodes of first states."""

    network: Network
    owners: tuple[str, ...]
    entries: frozenset[int]


def build_unit_loop(hmm: UnitHmm, inventory: Sequence[str]) -> UnitLoop:
    """Return the loop over an inventory. Recordings begin and end in silence, or in any unit as if it were beside."""
    table, silence = hmm.table, hmm.table.free[0]
    builder = NetworkBuilder()
    owners: list[str] = []
    rows: dict[str, list[StateNodes]] = {}
    for unit in inventory:
        rows[unit] = []
        for state in range(table.count(unit)):
            row: StateNodes = {}
            for neighbour in _list_neighbours(table, unit, state, inventory):
                row[neighbour] = builder.state(table.density(unit, state, neighbour), hmm.stay(unit, state))
                owners.append(unit)
            if rows[unit]:
                _advance(builder, hmm, unit, state, rows[unit][-1], row)
            rows[unit].append(row)

    def leave(unit: str, following: str) -> float:
        """Return the score of the arc to another unit: with the language model's, unless an earlier arc has it."""
        score = 0.0 if following in rows[unit][-1] else _language_score(hmm, unit, following)
        return hmm.move(unit, len(rows[unit]) - 1) + score

    for unit in inventory:
        first, last = rows[unit][0], rows[unit][-1]
        for following in inventory:
            builder.arc(_node(last, following), _node(rows[following][0], unit), leave(unit, following))
        at_rest = unit == silence
        begin = hmm.config.insertion if at_rest else _language_score(hmm, silence, unit)
        builder.initial[_node(first, silence)] = begin
        end = hmm.move(unit, len(rows[unit]) - 1) if at_rest else leave(unit, silence)
        builder.final[_node(last, silence)] = end
    entries = frozenset(entry for unit_rows in rows.values() for entry in unit_rows[0].values())
    return UnitLoop(builder.build(), tuple(owners), entries)


def decode_path(loop: UnitLoop, path: NDArray[np.intp]) -> tuple[tuple[str, ...], NDArray[np.intp]]:
    """Return the units of a path through the loop [shape=(T,)], their first frames, and the frame count at the end."""
    starts = [t for t in range(len(path)) if t == 0 or (path[t] != path[t - 1] and path[t] in loop.entries)]
    return tuple(loop.owners[path[t]] for t in starts), np.array([*starts, len(path)], np.intp)


def _language_score(hmm: UnitHmm, unit: str, following: str) -> float:
    """Return the score of the language model: weighted log bigram plus insertion penalty."""
    return hmm.config.bigram_weight * hmm.bigram(unit, following) + hmm.config.insertion


def _node(row: StateNodes, neighbour: str) -> int:
    return row[neighbour] if neighbour in row else row[None]


def _list_neighbours(table: StateTable, unit: str, state: int, inventory: Sequence[str]) -> list[Neighbour]:
    """Return the neighbours that need a node of their own; all others (None) share a node, as they share densities.

    A neighbour that any state on one side of the unit depends on has nodes for all states on that side: so a node
    tells all that a path must know, and the search stays exact.
    """
    side = table.side(unit, state)
    same_side = [k for k in range(table.count(unit)) if table.side(unit, k) == side] if side else []
    distinct: list[Neighbour] = [
        neighbour
        for neighbour in inventory
        if any(table.density(unit, k, neighbour) != table.density(unit, k) for k in same_side)
    ]
    return distinct if len(distinct) == len(inventory) else [*distinct, None]


def _advance(
    builder: NetworkBuilder, hmm: UnitHmm, unit: str, state: int, sources: StateNodes, targets: StateNodes
) -> None:
    """Join two successive states of a unit; the arc that fixes the right neighbour has the language model's score."""
    move = hmm.move(unit, state - 1)
    same_side = hmm.table.side(unit, state - 1) == hmm.table.side(unit, state)
    chooses = hmm.table.side(unit, state) == ">" and not same_side
    for source_neighbour, source in sources.items():
        for neighbour, target in targets.items():
            if not same_side or source_neighbour == neighbour:
                score = _language_score(hmm, unit, neighbour) if chooses and neighbour is not None else 0.0
                builder.arc(source, target, move + score)
