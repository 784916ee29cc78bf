"""Recognition: the most probable unit sequence of a recording, without a transcript."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.log_likelihoods import LogLikelihoods
from lipmotion.hmm.model import UnitHmm
from lipmotion.hmm.network import Network, NetworkBuilder
from lipmotion.hmm.states import Neighbour

StateNodes = dict[Neighbour, int]
"""The nodes of one state of a unit: by neighbour, and under None the node for all other neighbours."""


@dataclass(frozen=True, eq=False)
class UnitLoop:
    """The network in which every unit may follow every other, which recognition searches.

    owners  : the unit of each node
    entries : the nodes of the units' first states
    """

    network: Network
    owners: tuple[str, ...]
    entries: frozenset[int]


def build_unit_loop(hmm: UnitHmm, inventory: Sequence[str]) -> UnitLoop:
    """Return the loop over an inventory, which includes silence (the first free unit).

    A recording begins and ends in silence, without a bigram there, or in any other unit, as if silence were beside it.
    """
    silence = hmm.table.free[0]
    builder = NetworkBuilder()
    owners: list[str] = []
    rows = {unit: _unit_rows(builder, owners, hmm, unit, inventory) for unit in inventory}
    for unit in inventory:
        _join(builder, hmm, unit, inventory, rows)
        if unit == silence:
            builder.initial(_node(rows[unit][0], silence), hmm.config.insertion)
            builder.final(_node(rows[unit][-1], silence), hmm.move(unit, len(rows[unit]) - 1))
        else:
            builder.initial(_node(rows[unit][0], silence), _language(hmm, silence, unit))
            builder.final(_node(rows[unit][-1], silence), _leave(hmm, unit, silence, rows))
    entries = frozenset(entry for unit_rows in rows.values() for entry in unit_rows[0].values())
    return UnitLoop(builder.build(), tuple(owners), entries)


def decode_units(
    loop: UnitLoop, log_likelihoods: LogLikelihoods, beam: float | None = None
) -> tuple[tuple[str, ...], NDArray[np.intp]]:
    """Return the most probable units, and the first frame of each, with the frame count at the end.

    beam : as in ``Network.best_path``; None: exact
    Viterbi over context-dependent states with the bigram (Hofer 2008, Eq. 5).
    """
    return decode_path(loop, loop.network.best_path(log_likelihoods, beam=beam))


def decode_path(loop: UnitLoop, path: NDArray[np.intp]) -> tuple[tuple[str, ...], NDArray[np.intp]]:
    """Return the units of a path through the loop [shape=(T,)], and their frames as ``decode_units`` does."""
    starts = [t for t in range(len(path)) if t == 0 or (path[t] != path[t - 1] and path[t] in loop.entries)]
    return tuple(loop.owners[path[t]] for t in starts), np.array([*starts, len(path)], np.intp)


def _language(hmm: UnitHmm, unit: str, following: str) -> float:
    """Return the score of the language model: weighted log bigram plus insertion penalty."""
    return hmm.config.bigram_weight * hmm.bigram(unit, following) + hmm.config.insertion


def _node(row: StateNodes, neighbour: str) -> int:
    return row[neighbour] if neighbour in row else row[None]


def _unit_rows(
    builder: NetworkBuilder, owners: list[str], hmm: UnitHmm, unit: str, inventory: Sequence[str]
) -> list[StateNodes]:
    """Add the states of one unit in all contexts, and the arcs between them; return the nodes of each state."""
    rows: list[StateNodes] = []
    for state in range(hmm.table.count(unit)):
        row: StateNodes = {}
        for context in _contexts(hmm, unit, state, inventory):
            row[context] = builder.state(hmm.table.density(unit, state, context), hmm.stay(unit, state))
            owners.append(unit)
        if rows:
            _advance(builder, hmm, unit, state, rows[-1], row)
        rows.append(row)
    return rows


def _contexts(hmm: UnitHmm, unit: str, state: int, inventory: Sequence[str]) -> list[Neighbour]:
    """Return the neighbours that need a node of their own; all others (None) share a node, as they share densities.

    A neighbour that any state on one side of the unit depends on has nodes for all states on that side: so a node
    tells all that a path must know, and the search stays exact.
    """
    side = hmm.table.side(unit, state)
    same_side = [k for k in range(hmm.table.count(unit)) if hmm.table.side(unit, k) == side] if side else []
    own: list[Neighbour] = [
        neighbour
        for neighbour in inventory
        if any(hmm.table.density(unit, k, neighbour) != hmm.table.density(unit, k) for k in same_side)
    ]
    return own if len(own) == len(inventory) else [*own, None]


def _advance(
    builder: NetworkBuilder, hmm: UnitHmm, unit: str, state: int, sources: StateNodes, targets: StateNodes
) -> None:
    """Join two successive states of a unit.

    The arc into the first node that fixes the right neighbour has the score of the language model.
    """
    move = hmm.move(unit, state - 1)
    same_side = hmm.table.side(unit, state - 1) == hmm.table.side(unit, state)
    chooses = hmm.table.side(unit, state) == ">" and not same_side
    for source_neighbour, source in sources.items():
        for neighbour, target in targets.items():
            if not same_side or source_neighbour == neighbour:
                score = _language(hmm, unit, neighbour) if chooses and neighbour is not None else 0.0
                builder.arc(source, target, move + score)


def _join(
    builder: NetworkBuilder, hmm: UnitHmm, unit: str, inventory: Sequence[str], rows: dict[str, list[StateNodes]]
) -> None:
    """Join the last state of a unit to the first state of every unit."""
    for following in inventory:
        entry = _node(rows[following][0], unit)
        builder.arc(_node(rows[unit][-1], following), entry, _leave(hmm, unit, following, rows))


def _leave(hmm: UnitHmm, unit: str, following: str, rows: dict[str, list[StateNodes]]) -> float:
    """Return the score of the arc from a unit to another: with the language model's, unless an earlier arc has it."""
    score = 0.0 if following in rows[unit][-1] else _language(hmm, unit, following)
    return hmm.move(unit, len(rows[unit]) - 1) + score
