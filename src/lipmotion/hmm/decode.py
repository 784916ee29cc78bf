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

Row = dict[Neighbour, int]
"""One state of a unit: its node for each neighbour that has one of its own, under None that for all others."""


@dataclass(frozen=True, eq=False)
class UnitLoop:
    """Every unit behind every other: what recognition searches.

    owners  : the unit of each node
    entries : the nodes of first states
    """

    network: Network
    owners: tuple[str, ...]
    entries: frozenset[int]


def unit_loop(hmm: UnitHmm, inventory: Sequence[str]) -> UnitLoop:
    """Return the loop over an inventory, silence (the first free unit) among it.

    A recording begins and ends in silence, which costs nothing there, or in a unit beside it.
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
    loop: UnitLoop, evidence: LogLikelihoods, beam: float | None = None
) -> tuple[tuple[str, ...], NDArray[np.intp]]:
    """Return the units said, and the first frame of each with the frame count at the end.

    beam : as in ``Network.best_path``; None: exact
    Viterbi over context-dependent states with the bigram (Hofer 2008, Eq. 5).
    """
    path = loop.network.best_path(evidence, beam=beam)
    starts = [t for t in range(len(path)) if t == 0 or (path[t] != path[t - 1] and path[t] in loop.entries)]
    return tuple(loop.owners[path[t]] for t in starts), np.array([*starts, len(path)], np.intp)


def _language(hmm: UnitHmm, unit: str, following: str) -> float:
    return hmm.config.bigram_weight * hmm.bigram(unit, following) + hmm.config.insertion


def _node(row: Row, neighbour: str) -> int:
    return row[neighbour] if neighbour in row else row[None]


def _unit_rows(
    builder: NetworkBuilder, owners: list[str], hmm: UnitHmm, unit: str, inventory: Sequence[str]
) -> list[Row]:
    """Add the states of one unit in all contexts, and the arcs between them."""
    rows: list[Row] = []
    for state in range(hmm.table.count(unit)):
        row: Row = {}
        for context in _contexts(hmm, unit, state, inventory):
            row[context] = builder.state(hmm.table.density(unit, state, context), hmm.stay(unit, state))
            owners.append(unit)
        if rows:
            _advance(builder, hmm, unit, state, rows[-1], row)
        rows.append(row)
    return rows


def _contexts(hmm: UnitHmm, unit: str, state: int, inventory: Sequence[str]) -> list[Neighbour]:
    """Return the neighbours that need a node of their own; all others share one, whose densities are the same.

    A neighbour known to any state on one side of the unit counts for all states on that side: so a path never
    has to remember more than its node says, and the search stays exact.
    """
    side = hmm.table.side(unit, state)
    alike = [k for k in range(hmm.table.count(unit)) if hmm.table.side(unit, k) == side] if side else []
    own: list[Neighbour] = [
        neighbour
        for neighbour in inventory
        if any(hmm.table.density(unit, k, neighbour) != hmm.table.density(unit, k) for k in alike)
    ]
    return own if len(own) == len(inventory) else [*own, None]


def _advance(builder: NetworkBuilder, hmm: UnitHmm, unit: str, state: int, sources: Row, targets: Row) -> None:
    """Join two successive states of a unit; a node that fixes the right neighbour is paid for on the way in."""
    move = hmm.move(unit, state - 1)
    same_side = hmm.table.side(unit, state - 1) == hmm.table.side(unit, state)
    pays = hmm.table.side(unit, state) == ">" and not same_side
    for met, source in sources.items():
        for wanted, target in targets.items():
            if not same_side or met == wanted:
                price = _language(hmm, unit, wanted) if pays and wanted is not None else 0.0
                builder.arc(source, target, move + price)


def _join(
    builder: NetworkBuilder, hmm: UnitHmm, unit: str, inventory: Sequence[str], rows: dict[str, list[Row]]
) -> None:
    """Join the end of a unit to every unit that may follow."""
    for following in inventory:
        entry = _node(rows[following][0], unit)
        builder.arc(_node(rows[unit][-1], following), entry, _leave(hmm, unit, following, rows))


def _leave(hmm: UnitHmm, unit: str, following: str, rows: dict[str, list[Row]]) -> float:
    """Return the price of going from a unit to another: the bigram, unless the node that is left has paid it."""
    price = 0.0 if following in rows[unit][-1] else _language(hmm, unit, following)
    return hmm.move(unit, len(rows[unit]) - 1) + price
