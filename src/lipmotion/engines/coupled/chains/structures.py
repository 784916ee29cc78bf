"""Structures of chains, and the six systems of Xie & Liu 2007 by name."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from lipmotion.errors import InputError
from lipmotion.units import PHONES, UnitSet, load_unit_set

HMM, MULTISTREAM, FACTORIAL, COUPLED = "hmm", "multistream", "factorial", "coupled"
STRUCTURES = (HMM, MULTISTREAM, FACTORIAL, COUPLED)
UNSEEN_LOSS = 10.0
"""Chosen on the validation list (docs/results/xieliu2007.md)."""

AS_PRINTED: dict[str, Any] = {
    "states": 5,
    "mixtures": 1,
    "conversion": "em",
    "start": "viterbi",
    "steps": 5,
    "variance_scaling": False,
    "closures": False,
    "articulation": False,
}
"""What the paper's systems have in common: five states a unit, lips converted frame by frame, by EM that starts from
the best path, and nothing done to them afterwards (§4.1, §7.1). Ours, as the print gives no number: one Gaussian a
state, five steps of EM ("a very few").
"""
FREE: dict[str, Any] = {"asynchrony": -1, "unseen_loss": 0.0, "start_asynchrony": 4}
"""Factorial chains that nothing ties together: every density integrates to 1, and they may be apart from the start."""
SYSTEMS: dict[str, dict[str, Any]] = {
    "ph-HMM": AS_PRINTED | {"structure": HMM, "chains": "phone"},
    "ph-MSHMM": AS_PRINTED | {"structure": MULTISTREAM, "chains": "phone"},
    "ph-FHMM": AS_PRINTED | FREE | {"structure": FACTORIAL, "chains": "phone phone"},
    "ph-vi-FHMM": AS_PRINTED | FREE | {"structure": FACTORIAL, "chains": "phone viseme"},
    "ph-CHMM": AS_PRINTED | {"structure": COUPLED, "chains": "phone phone"},
    "ph-vi-CHMM": AS_PRINTED | {"structure": COUPLED, "chains": "phone viseme"},
}
"""Options of the coupled engine for each system. Source: Xie & Liu 2007, Table 2."""
PRESETS: dict[str, dict[str, Any]] = SYSTEMS | {"xieliu2007": AS_PRINTED}
"""The systems by name, and what they share: alone it is the one that the paper proposes, ph-vi-CHMM."""


@dataclass(frozen=True)
class Structure:
    """The chains, their units, and how the chains depend on each other.

    kind        : ``hmm`` (one chain, one mixture over all streams), ``multistream`` (one chain, one mixture for each
                  stream), ``factorial`` (chains with independent transitions, emission densities of joint states) or
                  ``coupled`` (chains whose transitions depend on the states of all chains, emission densities of each
                  chain's states)
    chains      : the unit set of each chain; the first chain emits speech, and its bigram decides which unit follows
    states      : states per unit, left to right, without skips
    limit       : the greatest asynchrony, in states; None: no limit
    cross_units : whether chains may leave a unit at different times
    start_limit : without a limit, the one that holds while the first densities are learned (Viterbi training)
    unseen_loss : without a limit, what the log density of a joint state without a density of its own loses, nats; 0:
                  all densities integrate to 1, and nothing but the shared densities holds the chains together
    moves_together : of coupled chains: whether the chance that a chain moves on depends also on which chains before it
                  move in the same frame. In Eq. 2 it depends on the joint state before alone, so that chains in step
                  must fall out of step, for a frame at least, nearly wherever one moves
    Source: Xie & Liu 2007, Fig. 3 and Eqs. 17–19.
    Raises InputError: an unknown kind, or a number of chains or limit that does not fit it.
    """

    kind: str
    chains: tuple[UnitSet, ...]
    states: int
    limit: int | None
    cross_units: bool = True
    start_limit: int = 1
    unseen_loss: float = UNSEEN_LOSS
    moves_together: bool = False

    def __post_init__(self) -> None:
        if self.kind not in STRUCTURES:
            raise InputError(f"structure is {self.kind!r}, required one of: {', '.join(STRUCTURES)}")
        if (self.kind in (HMM, MULTISTREAM)) != (len(self.chains) == 1):
            raise InputError(f"structure {self.kind} with {len(self.chains)} chains; hmm and multistream have one")
        if self.moves_together and self.kind != COUPLED:
            raise InputError(f"moves_together with the structure {self.kind}; required {COUPLED}")
        if self.limit is None and (self.kind != FACTORIAL or len(self.chains) != 2):
            raise InputError("asynchrony is -1, no limit, which only two factorial chains have")
        if self.limit is not None and not 0 <= self.limit < self.states:
            raise InputError(
                f"asynchrony is {self.limit} states, required 0 to {self.states - 1} (fewer than a unit has), or -1"
            )

    @cached_property
    def units(self) -> tuple[tuple[str, ...], ...]:
        """The units of every chain; those of the first are sorted by the corresponding units of the others."""
        first, *others = self.chains
        key = {
            unit: [chain.units.index(find_matching_unit(chain, first, unit)) for chain in others]
            for unit in first.units
        }
        return (tuple(sorted(first.units, key=lambda unit: key[unit])), *(chain.units for chain in others))

    @cached_property
    def corresponding_units(self) -> tuple[tuple[int, ...], ...]:
        """For each chain, the number of its unit that corresponds to each unit of the first chain."""
        return tuple(
            tuple(units.index(find_matching_unit(chain, self.chains[0], unit)) for unit in self.units[0])
            for chain, units in zip(self.chains, self.units, strict=True)
        )

    @cached_property
    def state_counts(self) -> tuple[int, ...]:
        """The number of states of each chain."""
        return tuple(len(units) * self.states for units in self.units)

    def chain_of(self, stream: int) -> int:
        """Return the chain that emits a stream: the first emits speech, the others the visual streams in order."""
        return min(stream, len(self.chains) - 1)

    def name(self, states: Iterable[int]) -> str:
        """Return the name of a joint state, given that of each chain: ``b.1 | bi.2``, with states counted from 1."""
        return " | ".join(self.state_name(chain, state) for chain, state in enumerate(states))

    def state_name(self, chain: int, state: int) -> str:
        """Return the name of a state of one chain, as ``b.1``."""
        unit, position = divmod(state, self.states)
        return f"{self.units[chain][unit]}.{position + 1}"


def list_unit_sets(names: str) -> tuple[UnitSet, ...]:
    """Return the unit sets named, or read from files, in a text. Raises InputError: none, or no such set."""
    sets = tuple(load_unit_set(name) for name in names.split())
    if not sets:
        raise InputError("no chains were given; required the unit set of each, as in 'phone viseme'")
    return sets


def find_matching_unit(chain: UnitSet, first: UnitSet, unit: str) -> str:
    """Return the unit of a chain that corresponds to a unit of the first chain: that of most of its phones."""
    if chain is first:
        return unit
    units = [chain.unit(phone) for phone in PHONES if first.unit(phone) == unit]
    return max(units, key=units.count)
