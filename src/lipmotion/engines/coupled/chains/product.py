"""The joint states that chains can reach together, and what leads from one to the next."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.structures import Structure
from lipmotion.errors import InputError

Index = NDArray[np.intp]
MOST_ARCS = 200_000
"""Of products without a limit, which are listed arc by arc."""


class Joint(NamedTuple):
    """Where every chain is.

    units, states : of every chain
    ahead         : whether it has left the unit that others are still in
    """

    units: tuple[int, ...]
    states: tuple[int, ...]
    ahead: tuple[bool, ...]


class Grammar(NamedTuple):
    """Which units follow which, chain by chain; chains with an asynchrony limit all go by that of the first.

    bigrams : P(next unit | unit) [each shape=(U_c, U_c)], all more than 0
    firsts  : probability that a recording begins with each unit [each shape=(U_c,)]
    """

    bigrams: tuple[NDArray[np.float64], ...]
    firsts: tuple[NDArray[np.float64], ...]


@dataclass(frozen=True, eq=False)
class Product:
    """The reachable joint states of chains, and the arcs between them.

    grammar  : as given to ``reachable``
    joints   : S states
    arc_from : [shape=(E,)], the source states of all arcs, sorted by target
    arc_to   : [shape=(E,)]
    moves    : bool array [shape=(C, E)], which chains an arc moves on
    base     : [shape=(E,)], probability of the unit it leads to, among those that it may lead to
    initial  : [shape=(S,)], probability of beginning in each state
    Source: Xie & Liu 2007, Eqs. 17–19. The mask of Eq. 19 limits the current states, so what is left of a row of the
    tables is made to sum to 1 again (``transitions``).
    """

    structure: Structure
    grammar: Grammar
    joints: tuple[Joint, ...]
    arc_from: Index
    arc_to: Index
    moves: NDArray[np.bool_]
    base: NDArray[np.float64]
    initial: NDArray[np.float64]

    @cached_property
    def arc_start(self) -> Index:
        """Where each target's arcs begin [shape=(S,)]."""
        return np.searchsorted(self.arc_to, np.arange(len(self.joints)))

    @cached_property
    def chain_states(self) -> Index:
        """The state of every chain in each joint state [shape=(C, S)]."""
        chains = range(len(self.structure.chains))
        return np.array(
            [[self.structure.state(joint.units[c], joint.states[c]) for joint in self.joints] for c in chains], np.intp
        )

    @cached_property
    def lead(self) -> Index:
        """How many states each chain is ahead of the first [shape=(C, S)]."""
        count = self.structure.states
        places = np.array([[s + count * a for s, a in zip(j.states, j.ahead, strict=True)] for j in self.joints]).T
        return places - places[0]

    def name(self, state: int) -> str:
        """Return what a joint state is, in words."""
        return self.structure.name(self.chain_states[:, state].tolist())


def reachable(structure: Structure, grammar: Grammar) -> Product:
    """Return the product of chains.

    With a limit of asynchrony all chains say the same units; without one each goes its own way.
    Raises InputError: chains without a limit that have too many joint states to list.
    """
    if structure.limit is None:
        return _unlimited(structure, grammar)
    chains = range(len(structure.chains))
    together, level = (False,) * len(chains), (0,) * len(chains)
    begins = {
        Joint(tuple(structure.follows[c][unit] for c in chains), level, together): float(probability)
        for unit, probability in enumerate(grammar.firsts[0])
    }
    walk = _Walk(structure, grammar.bigrams[0])
    found: dict[Joint, list[tuple[Joint, tuple[bool, ...], float]]] = {}
    waiting = deque(begins)
    while waiting:
        joint = waiting.popleft()
        if joint in found:
            continue
        found[joint] = list(walk.onward(joint))
        waiting.extend(target for target, _, _ in found[joint] if target not in found)
    joints = tuple(sorted(found, key=lambda j: (j.ahead, j.states, j.units[1:], j.units[0])))
    number = {joint: index for index, joint in enumerate(joints)}
    arcs = [(number[target], number[source], moved, base) for source, to in found.items() for target, moved, base in to]
    initial = np.zeros(len(joints))
    for joint, probability in begins.items():
        initial[number[joint]] = probability
    return _listed(structure, grammar, joints, arcs, initial)


_Arc = tuple[int, int, tuple[bool, ...], float]
"""Target, source, which chains move, and the probability of the units entered."""


def _listed(
    structure: Structure,
    grammar: Grammar,
    joints: tuple[Joint, ...],
    arcs: Iterable[_Arc],
    initial: NDArray[np.float64],
) -> Product:
    targets, sources, moves, base = zip(*sorted(arcs, key=lambda arc: arc[:2]), strict=True)
    return Product(
        structure,
        grammar,
        joints,
        np.array(sources, np.intp),
        np.array(targets, np.intp),
        np.array(moves, bool).T,
        np.array(base, float),
        initial / initial.sum(),
    )


def _unlimited(structure: Structure, grammar: Grammar) -> Product:
    """Return all combinations of the chains' states, each chain following arcs of its own."""
    chains = range(len(structure.chains))
    arcs = [_chain_arcs(structure, grammar.bigrams[chain]) for chain in chains]
    total = int(np.prod([len(own) for own in arcs]))
    if total > MOST_ARCS:
        raise InputError(
            f"{' and '.join(chain.name for chain in structure.chains)}: {total} arcs between joint states, at most "
            f"{MOST_ARCS}; limit the asynchrony, or take smaller unit sets"
        )
    states = list(product(*(range(count) for count in structure.counts)))
    joints = tuple(
        Joint(
            tuple(state // structure.states for state in joint),
            tuple(state % structure.states for state in joint),
            (False,) * len(joint),
        )
        for joint in states
    )
    number = {joint: index for index, joint in enumerate(states)}
    found = (
        (
            number[tuple(arc[1] for arc in together)],
            number[tuple(arc[0] for arc in together)],
            tuple(arc[2] for arc in together),
            float(np.prod([arc[3] for arc in together])),
        )
        for together in product(*arcs)
    )
    begins = [np.zeros(count) for count in structure.counts]
    for chain, own in enumerate(begins):
        own[:: structure.states] = grammar.firsts[chain]
    initial = np.array([np.prod([begins[c][state] for c, state in enumerate(joint)]) for joint in states])
    return _listed(structure, grammar, joints, found, initial)


def _chain_arcs(structure: Structure, bigram: NDArray[np.float64]) -> list[tuple[int, int, bool, float]]:
    """Return the source and target of one chain's arcs, whether they move on, and the probability of the unit."""
    arcs: list[tuple[int, int, bool, float]] = []
    for unit, row in enumerate(bigram):
        for place in range(structure.states):
            state = structure.state(unit, place)
            arcs.append((state, state, False, 1.0))
            if place < structure.states - 1:
                arcs.append((state, state + 1, True, 1.0))
        last = structure.state(unit, structure.states - 1)
        arcs += [(last, structure.state(entered, 0), True, float(share)) for entered, share in enumerate(row)]
    return arcs


@dataclass(frozen=True, eq=False)
class _Walk:
    structure: Structure
    bigram: NDArray[np.float64]

    def onward(self, joint: Joint) -> Iterator[tuple[Joint, tuple[bool, ...], float]]:
        """Give the states that may follow, which chains move, and the probability of the units entered."""
        for moved in product((False, True), repeat=len(joint.units)):
            leaving = tuple(
                move and state == self.structure.states - 1 for move, state in zip(moved, joint.states, strict=True)
            )
            if any(out and ahead for out, ahead in zip(leaving, joint.ahead, strict=True)):
                continue  # a second unit ahead
            if any(leaving) and not (self.structure.crosses or all(leaving)):
                continue
            states = tuple(
                0 if out else state + move for out, state, move in zip(leaving, joint.states, moved, strict=True)
            )
            ahead = tuple(out or was for out, was in zip(leaving, joint.ahead, strict=True))
            if not self._near(states, ahead):
                continue
            settled = (False,) * len(ahead) if all(ahead) else ahead
            for units, base in self._entered(joint, leaving):
                yield Joint(units, states, settled), moved, base

    def _near(self, states: tuple[int, ...], ahead: tuple[bool, ...]) -> bool:
        places = [state + self.structure.states * out for state, out in zip(states, ahead, strict=True)]
        return self.structure.limit is None or max(places) - min(places) <= self.structure.limit

    def _entered(self, joint: Joint, leaving: tuple[bool, ...]) -> Iterator[tuple[tuple[int, ...], float]]:
        """Give the units of all chains after those in ``leaving`` have entered the next one."""
        follows = self.structure.follows
        if not any(leaving):
            yield joint.units, 1.0
            return
        if joint.ahead[0]:  # what is said next is known
            yield self._with(joint, leaving, joint.units[0]), 1.0
            return
        row = self.bigram[joint.units[0]]
        fitting = [
            unit
            for unit in range(len(row))
            if all(
                follows[c][unit] == own
                for c, (own, out) in enumerate(zip(joint.units, joint.ahead, strict=True))
                if out
            )
        ]
        total = sum(row[unit] for unit in fitting)
        shares: dict[tuple[int, ...], float] = defaultdict(float)
        for unit in fitting:
            shares[self._with(joint, leaving, unit)] += float(row[unit] / total)
        yield from shares.items()

    def _with(self, joint: Joint, leaving: tuple[bool, ...], unit: int) -> tuple[int, ...]:
        return tuple(
            self.structure.follows[c][unit] if out else own
            for c, (own, out) in enumerate(zip(joint.units, leaving, strict=True))
        )
