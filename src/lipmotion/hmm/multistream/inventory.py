"""The units of a model, their states, and the chain of states that a sequence of units is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.stats.trees import Context

Place = tuple[Context, int]
"""A state in its context: (left, unit, right), and which state of the unit."""


@dataclass(frozen=True)
class Inventory:
    """All units that a model knows of, heard in training or not.

    names  : of the units
    free   : silent ones, whose sound depends on no neighbour; the first stands for all of them beside other units
    states : of every unit, left to right without skips; silent units but the first have one
    Raises InputError: no silent unit, one that is no unit, a unit named twice or with a space, or no state.
    """

    names: tuple[str, ...]
    free: tuple[str, ...]
    states: int

    def __post_init__(self) -> None:
        if not self.free or not set(self.free) <= set(self.names):
            raise InputError(f"silent units {' '.join(self.free)!r}; required one or more of {' '.join(self.names)!r}")
        if len(set(self.names)) < len(self.names) or any(len(name.split()) != 1 for name in self.names):
            raise InputError(f"units {self.names}; required different names without spaces")
        if self.states < 1:
            raise InputError(f"{self.states} states a unit, required one or more")

    @property
    def silence(self) -> str:
        """The unit beyond both ends of every utterance."""
        return self.free[0]

    def count(self, unit: str) -> int:
        """Return how many states a unit has."""
        return 1 if unit in self.free[1:] else self.states

    @cached_property
    def rows(self) -> dict[tuple[str, int], int]:
        """The number of every state of every unit, without context."""
        states = [(unit, state) for unit in self.names for state in range(self.count(unit))]
        return {state: row for row, state in enumerate(states)}

    @cached_property
    def trees(self) -> dict[str, tuple[str, int]]:
        """The name of every tree, and a state that is in it: one a position, for silent units of their own."""
        positions = {str(state): ("", state) for state in range(self.states)}
        return positions | {f"{unit}.{state}": (unit, state) for unit, state in self.rows if unit in self.free}

    def tree(self, unit: str, state: int) -> str:
        """Return the name of the tree of a state."""
        return f"{unit}.{state}" if unit in self.free else str(state)

    def side(self, unit: str, state: int) -> int:
        """Return -1 where a state is before its unit's middle, 1 after it, 0 in it and in silence."""
        middle = 2 * state + 1 - self.count(unit)
        return 0 if unit in self.free else (middle > 0) - (middle < 0)

    def contexts(self, units: Sequence[str]) -> list[Context]:
        """Return every unit of a sequence between its neighbours; beyond the ends lies silence.

        Raises InputError: a unit that is not in the inventory.
        """
        unknown = sorted(set(units) - set(self.names))
        if unknown:
            raise InputError(f"unknown unit {unknown[0]!r}; the model's units: {' '.join(self.names)}")
        beside = [self.silence, *(self.silence if unit in self.free else unit for unit in units), self.silence]
        return list(zip(beside, units, beside[2:], strict=False))


@dataclass(frozen=True, eq=False)
class States:
    """The states of a sequence of units, one after another.

    places    : every state in its context
    positions : [shape=(S,)], which unit of the sequence it belongs to
    rows      : [shape=(S,)], the state without context, which carries its duration
    """

    places: tuple[Place, ...]
    positions: NDArray[np.intp]
    rows: NDArray[np.intp]


def states_of(inventory: Inventory, units: Sequence[str]) -> States:
    """Return the states of a sequence of units. Raises InputError: an unknown unit."""
    contexts = inventory.contexts(units)
    counts = [inventory.count(unit) for unit in units]
    places = tuple((context, state) for context, count in zip(contexts, counts, strict=True) for state in range(count))
    rows = np.array([inventory.rows[context[1], state] for context, state in places], np.intp)
    return States(places, np.repeat(np.arange(len(units)), counts), rows)
