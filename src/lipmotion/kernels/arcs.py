"""The layout of the arcs of a network in memory, for vectorised kernels.

States are put into an order in which arcs come in **runs**: consecutive sources lead to consecutive targets, and a
run is processed as one vector. Where many states share the same many sources, as the first states of all phones in a
loop do, their arcs are a **block**, a dense matrix. Arcs from a state to itself are always in runs.
"""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.intp]

MIN_BLOCK = 8  # sources, and targets, that a block has at least
PADDING_ROWS = 16  # rows of a block are padded to a multiple of this


class ArcLayout(NamedTuple):
    """The layout of a network's arcs. A place is the position of a state in the new order.

    order, place : [shape=(S,)], the state at each place, and the place of each state
    runs         : [shape=(R, 4)], first target's place, first source's place, length, position in ``run_arcs``
    run_arcs     : [shape=(N,)], the numbers of arcs, run after run
    blocks       : [shape=(B, 4)], first target's place, number of targets, position of the first source in
        ``block_sources``, number of sources
    block_sources : [shape=(X,)], the places of sources, block after block
    block_arcs   : [shape=(X, Y)], the arc from each source to each target of its block, padded with -1
    """

    order: Index
    place: Index
    runs: Index
    run_arcs: Index
    blocks: Index
    block_sources: Index
    block_arcs: Index


def lay_out_arcs(arc_from: Index, arc_start: Index) -> ArcLayout:
    """Return the layout of a network whose arcs are sorted by target: their sources, and each target's first arc."""
    states = len(arc_start)
    arc_to = np.repeat(np.arange(states), np.diff(arc_start, append=len(arc_from)))
    groups = _group_states(arc_from, arc_start)
    blocked = np.zeros(len(arc_from), bool)
    for _, arcs in groups:
        blocked[arcs] = True
    rest = np.flatnonzero(~blocked)
    order = _order_states(states, groups, arc_from[rest], arc_to[rest])
    place = np.empty(states, np.intp)
    place[order] = np.arange(states)
    source, target = place[arc_from[rest]], place[arc_to[rest]]
    positions = np.lexsort((target, target - source))
    source, target = source[positions], target[positions]
    broken = (np.diff(target) != 1) | (np.diff(source) != 1)
    firsts = np.append(0, np.flatnonzero(broken) + 1) if len(target) else np.empty(0, np.intp)
    lengths = np.diff(firsts, append=len(target))
    runs = np.stack([target[firsts], source[firsts], lengths, firsts], axis=1).astype(np.intp)
    return ArcLayout(order, place, runs, rest[positions], *_fill_blocks(groups, arc_from, place))


_Groups = list[tuple[Index, Index]]
"""Each block's states with the same sources, and their arcs [shape=(sources, targets)]."""


def _group_states(arc_from: Index, arc_start: Index) -> _Groups:
    members: dict[bytes, list[tuple[int, Index]]] = defaultdict(list)
    stops = np.append(arc_start[1:], len(arc_from))
    for state in np.flatnonzero(stops - arc_start >= MIN_BLOCK):
        arcs = np.arange(arc_start[state], stops[state])
        arcs = arcs[arc_from[arcs] != state]
        arcs = arcs[np.argsort(arc_from[arcs], kind="stable")]
        if len(arcs) >= MIN_BLOCK:
            members[arc_from[arcs].tobytes()].append((int(state), arcs))
    return [
        (np.array([state for state, _ in group], np.intp), np.stack([arcs for _, arcs in group], axis=1))
        for group in members.values()
        if len(group) >= MIN_BLOCK
    ]


def _order_states(states: int, groups: _Groups, source: Index, target: Index) -> Index:
    """Return the states in their new order: the targets of each block, the states one arc after them, and so on."""
    if not groups:
        return np.arange(states)
    group, depth = np.full(states, len(groups)), np.zeros(states, np.intp)
    for number, (targets, _) in enumerate(groups):
        group[targets] = number
    onward = (source != target) & (group[target] == len(groups))
    for before, after in zip(source[onward].tolist(), target[onward].tolist(), strict=True):
        depth[after] = depth[before] + 1
    depth[group < len(groups)] = 0
    return np.lexsort((group, depth))


def _fill_blocks(groups: _Groups, arc_from: Index, place: Index) -> tuple[Index, Index, Index]:
    total = sum(len(arcs) for _, arcs in groups)
    widest = max((-(-len(targets) // PADDING_ROWS) * PADDING_ROWS for targets, _ in groups), default=PADDING_ROWS)
    blocks, sources = np.empty((len(groups), 4), np.intp), np.empty(total, np.intp)
    matrix, first = np.full((total, widest), -1), 0
    for number, (targets, arcs) in enumerate(groups):
        blocks[number] = place[targets[0]], len(targets), first, len(arcs)
        sources[first : first + len(arcs)] = place[arc_from[arcs[:, 0]]]
        matrix[first : first + len(arcs), : len(targets)] = arcs
        first += len(arcs)
    return blocks, sources, matrix
