"""The table of tied states: the density of each state of each unit in each context."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Neighbour = str | None
"""The neighbouring unit that a state depends on; None: none."""


@dataclass(frozen=True)
class StateTable:
    """The tied states of an inventory of units.

    States before a unit's middle depend on the unit to the left, those after it on the one to the right, and
    the middle one (of an odd count) on neither: so whole sequences of context-dependent units can be searched
    exactly with units² nodes instead of units³. A state in a context too rare to be modelled is that without context.

    units    : the inventory
    counts   : number of states of each unit
    names    : of all densities: ``b.0`` (no context), ``b.0<ih`` (left), ``b.2>ih`` (right)
    free     : units whose states depend on no neighbour (silence)
    """

    units: tuple[str, ...]
    counts: tuple[int, ...]
    names: tuple[str, ...]
    free: tuple[str, ...]

    @cached_property
    def _index(self) -> dict[str, int]:
        return {name: index for index, name in enumerate(self.names)}

    def count(self, unit: str) -> int:
        """Return the number of states of a unit."""
        return self.counts[self.units.index(unit)]

    def side(self, unit: str, state: int) -> str:
        """Return ``<`` for a state that depends on the left neighbour, ``>`` on the right one, "" on none."""
        count = self.count(unit)
        if unit in self.free or 2 * state + 1 == count:
            return ""
        return "<" if 2 * state + 1 < count else ">"

    def name(self, left: str, unit: str, right: str, state: int) -> str:
        """Return the full name of a state in its context, whether or not it has a density of its own."""
        side = self.side(unit, state)
        return f"{unit}.{state}" + (side + {"<": left, ">": right}[side] if side else "")

    def density(self, unit: str, state: int, neighbour: Neighbour = None) -> int:
        """Return the density of a state beside a neighbour, or the one without context where there is none for it."""
        if neighbour is not None:
            density = self._index.get(f"{unit}.{state}{self.side(unit, state)}{neighbour}")
            if density is not None:
                return density
        return self._index[f"{unit}.{state}"]

    def neighbour(self, left: str, unit: str, right: str, state: int) -> Neighbour:
        """Return the neighbour that a state depends on."""
        return {"<": left, ">": right, "": None}[self.side(unit, state)]

    def parents(self) -> NDArray[np.intp]:
        """Return the density without context of the same state, for every density [shape=(G,)]."""
        return np.array([self._index[re.split("[<>]", name)[0]] for name in self.names], np.intp)

    def extended(self, names: tuple[str, ...]) -> StateTable:
        """Return the table with more densities, of these names, at its end."""
        return StateTable(self.units, self.counts, self.names + names, self.free)


def make_plain_states(units: tuple[str, ...], counts: tuple[int, ...], free: tuple[str, ...]) -> StateTable:
    """Return the table of states without context."""
    names = tuple(f"{unit}.{state}" for unit, count in zip(units, counts, strict=True) for state in range(count))
    return StateTable(units, counts, names, free)
