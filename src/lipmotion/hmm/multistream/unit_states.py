"""The units of a multi-stream model, the states that a sequence of units consists of, and units in time and frames."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.stats.trees import Context
from lipmotion.types import FRAME_RATE_HZ, Span, Timeline, Unit, frames_of

TriphoneState = tuple[Context, int]
"""A state in context: (left neighbour, unit, right neighbour), and the state's position in the unit."""


@dataclass(frozen=True)
class Inventory:
    """All units that a model can have, whether or not they occurred in training.

    free   : the silent ones, whose sound depends on no neighbour; as neighbours, all are represented by the first
    states : number of states of a unit, left to right without skips; silent units but the first have one
    Raises InputError: no silent unit, one that is no unit, or a unit named twice or with a space.
    """

    names: tuple[str, ...]
    free: tuple[str, ...]
    states: int

    def __post_init__(self) -> None:
        if not self.free or not set(self.free) <= set(self.names):
            raise InputError(f"silent units {' '.join(self.free)!r}; required one or more of {' '.join(self.names)!r}")
        if len(set(self.names)) < len(self.names) or any(len(name.split()) != 1 for name in self.names):
            raise InputError(f"units {self.names}; required different names without spaces")

    @property
    def silence(self) -> str:
        """The unit beyond both ends of every utterance."""
        return self.free[0]

    def count(self, unit: str) -> int:
        """Return how many states a unit has."""
        return 1 if unit in self.free[1:] else self.states

    @cached_property
    def monophones(self) -> dict[tuple[str, int], int]:
        """The number of every state without context: of (unit, position in the unit)."""
        states = [(unit, state) for unit in self.names for state in range(self.count(unit))]
        return {state: row for row, state in enumerate(states)}

    @cached_property
    def trees(self) -> dict[str, tuple[str, int]]:
        """The name and one state of every tree: one tree for each position, and others for silent units."""
        positions = {str(state): ("", state) for state in range(self.states)}
        return positions | {f"{unit}.{state}": (unit, state) for unit, state in self.monophones if unit in self.free}

    def tree(self, unit: str, state: int) -> str:
        """Return the name of the tree of a state."""
        return f"{unit}.{state}" if unit in self.free else str(state)

    def side(self, unit: str, state: int) -> int:
        """Return -1 for a state before its unit's middle, 1 after it, 0 in the middle and in silence."""
        middle = 2 * state + 1 - self.count(unit)
        return 0 if unit in self.free else (middle > 0) - (middle < 0)


@dataclass(frozen=True, eq=False)
class TriphoneStates:
    """The states of a sequence of units, one after another.

    positions  : [shape=(S,)], the unit of the sequence that it belongs to
    monophones : [shape=(S,)], the number of the state without context, which has its duration
    """

    triphones: tuple[TriphoneState, ...]
    positions: NDArray[np.intp]
    monophones: NDArray[np.intp]


def expand_triphones(inventory: Inventory, units: Sequence[str]) -> TriphoneStates:
    """Return the states of a sequence of units, with silence at its ends. Raises InputError: an unknown unit."""
    unknown = sorted(set(units) - set(inventory.names))
    if unknown:
        raise InputError(f"unknown unit {unknown[0]!r}; the model's units: {' '.join(inventory.names)}")
    silence, free = inventory.silence, inventory.free
    neighbours = [silence, *(silence if unit in free else unit for unit in units), silence]
    contexts = zip(neighbours, units, neighbours[2:], strict=False)
    counts = [inventory.count(unit) for unit in units]
    pairs = zip(contexts, counts, strict=True)
    triphones = tuple((context, state) for context, count in pairs for state in range(count))
    monophones = np.array([inventory.monophones[context[1], state] for context, state in triphones], np.intp)
    return TriphoneStates(triphones, np.repeat(np.arange(len(units)), counts), monophones)


def units_to_frames(
    units: Timeline[Unit], frames: int, silence: str, unit_of: Callable[[Unit], str] = attrgetter("phone")
) -> tuple[tuple[str, ...], NDArray[np.intp]]:
    """Return the units of a recording, and the first frame of each, with the frame count at the end.

    frames  : T > 0; frame n belongs to the unit at n · 10 ms
    silence : the unit for gaps between the given ones
    unit_of : gives the name of a unit; by default its phone
    A unit without a frame of its own is left out.
    Raises InputError: no frames.
    """
    if frames < 1:
        raise InputError(f"{frames} frames, required one or more")
    names: list[str] = []
    firsts: list[int] = []
    end = 0
    for span in units:
        first, stop = (max(edge, end) for edge in frames_of(span, frames))
        if first > end:
            names.append(silence)
            firsts.append(end)
        if stop > first:
            names.append(unit_of(span.label))
            firsts.append(first)
        end = max(end, stop)
    if end < frames:
        names.append(silence)
        firsts.append(end)
    return tuple(names), np.array([*firsts, frames], np.intp)


def frames_to_units(labels: Iterable[Unit], bounds: NDArray[np.intp], duration_s: float) -> Timeline[Unit]:
    """Return units with the bounds of ``units_to_frames`` from 0 s to ``duration_s``: frame n is (n ± ½) · 10 ms."""
    edges = np.clip((bounds[:-1] - 0.5) / FRAME_RATE_HZ, 0, duration_s).tolist()
    return Timeline(tuple(Span(*each) for each in zip(edges, [*edges[1:], duration_s], labels, strict=True)))
