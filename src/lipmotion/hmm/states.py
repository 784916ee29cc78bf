"""Which density stands behind which state of which unit in which context."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Neighbour = str | None
"""The neighbouring unit a state depends on; None: it depends on none."""


@dataclass(frozen=True)
class StateTable:
    """The tied states of an inventory of units.

    States before a unit's middle depend on the unit to the left, those after it on the one to the right, and
    the middle one (of an odd count) on neither: so whole sequences of context-dependent units can be searched
    exactly with units² nodes instead of units³. A context seen too rarely resolves to the state without one.

    units    : the inventory
    counts   : states per unit
    names    : one name a density: ``b.0`` (no context), ``b.0<ih`` (left), ``b.2>ih`` (right)
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
        """Return how many states a unit has."""
        return self.counts[self.units.index(unit)]

    def side(self, unit: str, state: int) -> str:
        """Return ``<`` or ``>`` where the state depends on the left or right neighbour, else nothing."""
        count = self.count(unit)
        if unit in self.free or 2 * state + 1 == count:
            return ""
        return "<" if 2 * state + 1 < count else ">"

    def name(self, left: str, unit: str, right: str, state: int) -> str:
        """Return the full name of a state in its context, whether or not it has a density of its own."""
        side = self.side(unit, state)
        return f"{unit}.{state}" + (side + {"<": left, ">": right}[side] if side else "")

    def density(self, unit: str, state: int, neighbour: Neighbour = None) -> int:
        """Return the density of a state; without one for this neighbour, the one without context."""
        if neighbour is not None:
            found = self._index.get(f"{unit}.{state}{self.side(unit, state)}{neighbour}")
            if found is not None:
                return found
        return self._index[f"{unit}.{state}"]

    def neighbour(self, left: str, unit: str, right: str, state: int) -> Neighbour:
        """Return the neighbour that a state depends on."""
        return {"<": left, ">": right, "": None}[self.side(unit, state)]

    def parents(self) -> NDArray[np.intp]:
        """Return, for every density, the one without context that stands behind it [shape=(G,)]."""
        return np.array([self._index[re.split("[<>]", name)[0]] for name in self.names], np.intp)

    def extended(self, names: tuple[str, ...]) -> StateTable:
        """Return the table with more densities at its end."""
        return StateTable(self.units, self.counts, self.names + names, self.free)


def plain_states(units: tuple[str, ...], counts: tuple[int, ...], free: tuple[str, ...]) -> StateTable:
    """Return the table of states without context."""
    names = tuple(f"{unit}.{state}" for unit, count in zip(units, counts, strict=True) for state in range(count))
    return StateTable(units, counts, names, free)
