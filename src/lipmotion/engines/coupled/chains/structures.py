"""Structures of chains, and the six systems of the paper by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from lipmotion.errors import InputError
from lipmotion.units import PHONES, UnitSet, unit_set

HMM, MULTISTREAM, FACTORIAL, COUPLED = "hmm", "multistream", "factorial", "coupled"
STRUCTURES = (HMM, MULTISTREAM, FACTORIAL, COUPLED)

SYSTEMS: dict[str, dict[str, Any]] = {
    "ph-HMM": {"structure": HMM, "chains": "phone"},
    "ph-MSHMM": {"structure": MULTISTREAM, "chains": "phone"},
    "ph-FHMM": {"structure": FACTORIAL, "chains": "phone phone", "asynchrony": -1},
    "ph-vi-FHMM": {"structure": FACTORIAL, "chains": "phone viseme", "asynchrony": -1},
    "ph-CHMM": {"structure": COUPLED, "chains": "phone phone"},
    "ph-vi-CHMM": {"structure": COUPLED, "chains": "phone viseme"},
}
"""Options of the coupled engine. Source: Xie & Liu 2007, Table 2."""


@dataclass(frozen=True)
class Structure:
    """How many chains there are, what their units are, and how they depend on each other.

    kind   : ``hmm`` (one chain, one mixture over all streams), ``multistream`` (one chain, a mixture a stream),
             ``factorial`` (chains that move on their own, densities of the joint state) or ``coupled`` (chains whose
             moves depend on all chains, densities of their own states)
    chains : the unit set of each chain; speech is on the first, which also decides what is said
    states : states per unit, left to right, no skips
    limit  : how many states chains may be apart; None: any number
    crosses : whether chains may leave a unit at different times
    Source: Xie & Liu 2007, Fig. 3 and Eqs. 17–19.
    Raises InputError: something does not fit together.
    """

    kind: str
    chains: tuple[UnitSet, ...]
    states: int
    limit: int | None
    crosses: bool = True

    def __post_init__(self) -> None:
        if self.kind not in STRUCTURES:
            raise InputError(f"structure is {self.kind!r}, required one of: {', '.join(STRUCTURES)}")
        if (self.kind in (HMM, MULTISTREAM)) != (len(self.chains) == 1):
            raise InputError(f"structure {self.kind} with {len(self.chains)} chains; hmm and multistream have one")
        if self.limit is not None and not 0 <= self.limit < self.states:
            raise InputError(
                f"asynchrony is {self.limit} states, required 0 to {self.states - 1} (fewer than a unit has), or -1"
            )

    @cached_property
    def units(self) -> tuple[tuple[str, ...], ...]:
        """The units of every chain; those of the first that look alike on the others stand together."""
        first, *others = self.chains
        looks = {unit: [chain.units.index(unit_over(chain, first, unit)) for chain in others] for unit in first.units}
        return (tuple(sorted(first.units, key=lambda unit: looks[unit])), *(chain.units for chain in others))

    @cached_property
    def follows(self) -> tuple[tuple[int, ...], ...]:
        """The unit of every chain that goes with each unit of the first."""
        return tuple(
            tuple(units.index(unit_over(chain, self.chains[0], unit)) for unit in self.units[0])
            for chain, units in zip(self.chains, self.units, strict=True)
        )

    @cached_property
    def counts(self) -> tuple[int, ...]:
        """How many states every chain has."""
        return tuple(len(units) * self.states for units in self.units)

    def chain_of(self, stream: int) -> int:
        """Return the chain that a stream is on: speech on the first, all others in order on the rest."""
        return min(stream, len(self.chains) - 1)

    def name(self, states: Sequence[int]) -> str:
        """Return what the states of all chains are, in words: ``b.1 | bi.2``, unit and place, counted from 1."""
        return " | ".join(self.state_name(chain, state) for chain, state in enumerate(states))

    def state_name(self, chain: int, state: int) -> str:
        """Return what a state of one chain is, in words: ``b.1``."""
        unit, place = divmod(state, self.states)
        return f"{self.units[chain][unit]}.{place + 1}"

    def state(self, unit: int, state: int) -> int:
        """Return the number of a state within its chain."""
        return unit * self.states + state


def structure_of(kind: str, chains: str, states: int, asynchrony: int, crosses: bool) -> Structure:
    """Return a structure. Raises InputError: no such unit set, or something does not fit together.

    chains : names of unit sets or files of their tables, separated by blanks;  asynchrony : -1 stands for no limit
    """
    sets = tuple(unit_set(name) for name in chains.split())
    if not sets:
        raise InputError("no chains were given; required the unit set of each, as in 'phone viseme'")
    return Structure(kind, sets, states, None if asynchrony < 0 else asynchrony, crosses)


def unit_over(chain: UnitSet, first: UnitSet, unit: str) -> str:
    """Return the unit of a chain that goes with a unit of the first: that of most of its phones."""
    if chain is first:
        return unit
    units = [chain.unit(phone) for phone in PHONES if first.unit(phone) == unit]
    return max(units, key=units.count)
