"""Recognition: the most probable unit sequence of a recording, without a transcript."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.model import Neighbour, StateTable, UnitHmm
from lipmotion.hmm.network import LogLikelihoods, Network, NetworkBuilder

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
            for neighbour in _distinct_neighbours(table, unit, state, inventory):
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
        builder.initial(_node(first, silence), begin)
        builder.final(_node(last, silence), hmm.move(unit, len(rows[unit]) - 1) if at_rest else leave(unit, silence))
    entries = frozenset(entry for unit_rows in rows.values() for entry in unit_rows[0].values())
    return UnitLoop(builder.build(), tuple(owners), entries)


def decode_units(
    loop: UnitLoop, log_likelihoods: LogLikelihoods, beam: float | None = None
) -> tuple[tuple[str, ...], NDArray[np.intp]]:
    """Return the most probable units, their first frames, the frame count; ``beam`` as in ``Network.best_path``."""
    return decode_path(loop, loop.network.best_path(log_likelihoods, beam=beam))


def decode_path(loop: UnitLoop, path: NDArray[np.intp]) -> tuple[tuple[str, ...], NDArray[np.intp]]:
    """Return the units of a path through the loop [shape=(T,)], and their frames as ``decode_units`` does."""
    starts = [t for t in range(len(path)) if t == 0 or (path[t] != path[t - 1] and path[t] in loop.entries)]
    return tuple(loop.owners[path[t]] for t in starts), np.array([*starts, len(path)], np.intp)


def _language_score(hmm: UnitHmm, unit: str, following: str) -> float:
    """Return the score of the language model: weighted log bigram plus insertion penalty."""
    return hmm.config.bigram_weight * hmm.bigram(unit, following) + hmm.config.insertion


def _node(row: StateNodes, neighbour: str) -> int:
    return row[neighbour] if neighbour in row else row[None]


def _distinct_neighbours(table: StateTable, unit: str, state: int, inventory: Sequence[str]) -> list[Neighbour]:
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
