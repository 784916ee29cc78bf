"""Recognition: the most probable unit sequence of a recording, without a transcript."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.stats.hmm.model import UnitHmm
from lipmotion.stats.hmm.network import NetworkBuilder

Node = tuple[int, "str | None"]
"""A state of the network, and the neighbour it stands for (None: any)."""


def decode_units(
    hmm: UnitHmm, features: NDArray[np.float32], inventory: Sequence[str]
) -> tuple[tuple[str, ...], NDArray[np.intp]]:
    """Return the units said, and the first frame of each with the frame count at the end.

    features  : [shape=(T, D)]
    inventory : the units to choose from, silence (the first free unit) among them
    Viterbi over context-dependent states with the bigram (Hofer 2008, Eq. 5). A recording begins and ends
    in silence, which costs nothing there, or in a unit beside it.
    """
    silence = hmm.table.free[0]
    builder = NetworkBuilder()
    owners: list[str] = []
    rows = {unit: _unit_nodes(builder, owners, hmm, unit, inventory) for unit in inventory}
    for unit in inventory:
        for following in inventory:
            _join(builder, hmm, unit, following, rows)
        for entry, met in rows[unit][0]:
            if met in (None, silence):
                builder.initial(entry, hmm.config.insertion if unit == silence else _language(hmm, silence, unit))
        for leave, expected in rows[unit][-1]:
            if expected in (None, silence):
                price = _language(hmm, unit, silence) if expected is None and unit != silence else 0.0
                builder.final(leave, hmm.move(unit, len(rows[unit]) - 1) + price)
    path = builder.build().best_path(hmm.mixtures.log_likelihood(features))
    return _units_of(path, rows, owners)


def _language(hmm: UnitHmm, unit: str, following: str) -> float:
    return hmm.config.bigram_weight * hmm.bigram(unit, following) + hmm.config.insertion


def _unit_nodes(
    builder: NetworkBuilder, owners: list[str], hmm: UnitHmm, unit: str, inventory: Sequence[str]
) -> list[list[Node]]:
    """Add the states of one unit in all contexts, and the arcs between them."""
    rows: list[list[Node]] = []
    for state in range(hmm.table.count(unit)):
        contexts = inventory if hmm.table.side(unit, state) else [None]
        row = []
        for context in contexts:
            number = builder.state(hmm.table.density(unit, state, context), hmm.stay(unit, state))
            row.append((number, context))
            owners.append(unit)
        if rows:
            _advance(builder, hmm, unit, state, rows[-1], row)
        rows.append(row)
    return rows


def _advance(
    builder: NetworkBuilder, hmm: UnitHmm, unit: str, state: int, sources: list[Node], targets: list[Node]
) -> None:
    """Join two successive states of a unit; the one that fixes the right neighbour pays for it."""
    move = hmm.move(unit, state - 1)
    same_side = hmm.table.side(unit, state - 1) == hmm.table.side(unit, state)
    pays = hmm.table.side(unit, state) == ">" and not same_side
    for source, met in sources:
        for target, wanted in targets:
            if not same_side or met == wanted:
                price = _language(hmm, unit, wanted) if pays and wanted is not None else 0.0
                builder.arc(source, target, move + price)


def _join(builder: NetworkBuilder, hmm: UnitHmm, unit: str, following: str, rows: dict[str, list[list[Node]]]) -> None:
    """Join the end of a unit to the start of the one that follows."""
    move = hmm.move(unit, len(rows[unit]) - 1)
    for leave, expected in rows[unit][-1]:
        if expected not in (None, following):
            continue
        price = _language(hmm, unit, following) if expected is None else 0.0
        for entry, met in rows[following][0]:
            if met in (None, unit):
                builder.arc(leave, entry, move + price)


def _units_of(
    path: NDArray[np.intp], rows: dict[str, list[list[Node]]], owners: list[str]
) -> tuple[tuple[str, ...], NDArray[np.intp]]:
    """Return the units along a path: one begins where a first state is entered from another state."""
    entries = {entry for row in rows.values() for entry, _ in row[0]}
    starts = [t for t in range(len(path)) if t == 0 or (path[t] != path[t - 1] and path[t] in entries)]
    return tuple(owners[path[t]] for t in starts), np.array([*starts, len(path)], np.intp)
