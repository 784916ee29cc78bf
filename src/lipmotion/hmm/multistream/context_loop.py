"""The loop of all units in context, which recognition with multi-stream models searches."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.decode import UnitLoop
from lipmotion.hmm.multistream.model import JointHmm
from lipmotion.hmm.multistream.streams import ACOUSTIC_STREAMS
from lipmotion.hmm.network import NetworkBuilder

Grid = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class ContextLoop:
    """The network in which every unit that was spoken in training may follow every other, in context.

    network    : its densities are the columns of ``leaves``
    leaves     : by acoustic stream, the leaves of each distinct density [shape=(C,)]
    monophones : [shape=(nodes,)], the number of each node's state without context
    """

    network: UnitLoop
    leaves: dict[str, NDArray[np.intp]]
    monophones: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class _StateNodes:
    """The nodes of one state of a unit: one for each class of left and each of right neighbours that it tells apart.

    left, right : [shape=(N,)], the class of every neighbour
    numbers     : of the nodes [shape=(classes, classes)]

    A node stands for what the states from it on make of the left neighbour, and what the states up to it made of the
    right one: neighbours that these do not tell apart share it. So the search is exact with the fewest nodes.
    """

    left: NDArray[np.intp]
    right: NDArray[np.intp]
    numbers: Grid

    def after(self, neighbour: int) -> list[int]:
        """Return the nodes that have this left neighbour."""
        return [int(number) for number in self.numbers[self.left[neighbour], :]]

    def before(self, neighbour: int) -> list[int]:
        """Return the nodes that have this right neighbour."""
        return [int(number) for number in self.numbers[:, self.right[neighbour]]]


def context_loop(hmm: JointHmm) -> ContextLoop:
    """Return the loop of a model's units with the back-off bigram.

    A recording begins and ends in silence, without a bigram there, or in any other unit, as if silence were beside it.
    Source: Hofer 2008, Eq. 5.
    """
    inventory = hmm.inventory
    units = [unit for unit in hmm.spoken if unit not in inventory.free[1:]]
    leaves, densities = _densities(hmm, units)
    builder, owners, monophones = NetworkBuilder(), list[str](), list[int]()
    nodes: dict[str, list[_StateNodes]] = {}
    for unit in units:

        def add(density: int, monophone: int, unit: str = unit) -> int:
            owners.append(unit)
            monophones.append(monophone)
            return builder.state(density, float(hmm.log_stay[monophone]))

        rows = [inventory.monophones[unit, state] for state in range(inventory.count(unit))]
        nodes[unit] = _nodes_of(densities[unit], rows, add)
        for row, source, target in zip(rows, nodes[unit], nodes[unit][1:], strict=False):
            _advance(builder, source, target, float(hmm.log_move[row]))
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
            entered, score = nodes[following][0], leave + _price(hmm, unit, following)
            for source in last.before(place[following]):
                for target in entered.after(place[unit]):
                    builder.arc(source, target, score)
        for node in first.after(place[silence]):
            builder.initial(node, hmm.config.insertion if unit == silence else _price(hmm, silence, unit))
        for node in last.before(place[silence]):
            builder.final(node, leave + (0.0 if unit == silence else _price(hmm, unit, silence)))


def _price(hmm: JointHmm, unit: str, following: str) -> float:
    """Return the score of the language model: weighted log bigram plus insertion penalty."""
    return hmm.config.bigram_weight * hmm.bigram(unit, following) + hmm.config.insertion


def _densities(hmm: JointHmm, units: Sequence[str]) -> tuple[dict[str, NDArray[np.intp]], dict[str, Grid]]:
    """Return the leaves of distinct densities by stream, and by unit the density of each state beside N² neighbours.

    The grids have the shape (states, N, N): the left neighbour, then the right one.
    """
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


def _nodes_of(densities: Grid, rows: Sequence[int], add: Callable[[int, int], int]) -> list[_StateNodes]:
    """Return the nodes of all states of a unit.

    densities : [shape=(states, N, N)];  rows : the states without context;  add : adds a node
    """
    found = []
    for state, row in enumerate(rows):
        left = _classes(densities[state:].transpose(1, 0, 2))
        right = _classes(densities[: state + 1].transpose(2, 0, 1))
        _, first_left = np.unique(left, return_index=True)
        _, first_right = np.unique(right, return_index=True)
        grid = densities[state][np.ix_(first_left, first_right)]
        numbers = np.array([[add(int(density), row) for density in line] for line in grid], np.intp)
        found.append(_StateNodes(left, right, numbers))
    return found


def _classes(rows: Grid) -> NDArray[np.intp]:
    """Return the class of every row: those of equal rows are the same [shape=(N,)]."""
    return np.unique(rows.reshape(len(rows), -1), axis=0, return_inverse=True)[1].reshape(-1)


def _advance(builder: NetworkBuilder, source: _StateNodes, target: _StateNodes, log_move: float) -> None:
    """Join two successive states: left neighbours that the second tells apart, and right ones that the first did."""
    for left, left_after in set(zip(source.left.tolist(), target.left.tolist(), strict=True)):
        for right, right_after in set(zip(source.right.tolist(), target.right.tolist(), strict=True)):
            builder.arc(int(source.numbers[left, right]), int(target.numbers[left_after, right_after]), log_move)
