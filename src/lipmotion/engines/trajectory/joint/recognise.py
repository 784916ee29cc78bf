"""Recognition over a model's own units: the most probable sequence, or sequences drawn from all."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.joint.inventory import Place
from lipmotion.engines.trajectory.joint.model import JointHmm
from lipmotion.engines.trajectory.joint.streams import HEARD, MOTION, SPEECH, Observed, StreamWeights
from lipmotion.errors import AlignmentError, InputError
from lipmotion.kernels.sampling import sample_paths
from lipmotion.stats.bigram import Bigram
from lipmotion.stats.hmm.decode import UnitLoop, decode_units, unit_loop
from lipmotion.stats.hmm.evidence import Evidence
from lipmotion.stats.hmm.model import HmmConfig, UnitHmm
from lipmotion.stats.hmm.states import StateTable, plain_states
from lipmotion.stats.trees import Context


class Said(NamedTuple):
    """A unit, and the frame it begins with."""

    unit: str
    first: int


@dataclass(frozen=True, eq=False)
class JointRecogniser:
    """Searches the loop of all units that were heard in training, in their contexts, with the back-off bigram.

    hmm     : the models
    weights : of the streams; those of recognition by default
    Exact: trees of what is heard ask for one neighbour only. Where units have one state, one said twice in a row is
    heard as said once.
    Raises InputError: motion is not switched off: its trees ask for both neighbours.
    Source: Hofer 2008, Eq. 5.
    """

    hmm: JointHmm
    weights: StreamWeights | None = None

    def __post_init__(self) -> None:
        if MOTION in self._weights.on:
            raise InputError("recognition hears, and does not see: give the stream motion the weight 0")

    def recognise(self, observed: Observed) -> list[Said]:
        """Return the units that were most probably said.

        Raises InputError: no stream that is switched on was observed. Raises AlignmentError: too few frames.
        """
        units, starts = decode_units(self._loop, self._evidence(observed))
        return [Said(unit, int(first)) for unit, first in zip(units, starts[:-1], strict=True)]

    def sampled(self, observed: Observed, count: int, seed: int) -> list[list[Said]]:
        """Return sequences of units, drawn from all that may have been said, each as often as it is probable.

        Raises as ``recognise``.
        """
        if count < 1:
            raise InputError(f"{count} sequences, required one or more")
        evidence, network = self._evidence(observed), self._loop.network
        uniform = np.random.default_rng(seed).random((count, evidence.frames))
        paths, log_likelihood = sample_paths(
            evidence.log_density(0, evidence.frames, None), network.emission, network.arc_from, network.arc_log,
            network.arc_start, network.log_initial, network.log_final, uniform,
        )  # fmt: skip
        if not np.isfinite(log_likelihood):
            raise AlignmentError(f"no units fit into {evidence.frames} frames of 10 ms; give a longer recording")
        return [self._said(path) for path in paths]

    def _said(self, path: NDArray[np.intp]) -> list[Said]:
        entries = self._loop.entries
        starts = [t for t in range(len(path)) if t == 0 or (path[t] != path[t - 1] and int(path[t]) in entries)]
        return [Said(self._loop.owners[path[t]], t) for t in starts]

    @property
    def _weights(self) -> StreamWeights:
        return self.weights or self.hmm.config.recognition

    @cached_property
    def _states(self) -> _States:
        return _states(self.hmm)

    @cached_property
    def _loop(self) -> UnitLoop:
        inventory = self.hmm.inventory
        heard = [unit for unit in self.hmm.spoken if unit not in inventory.free[1:]]
        return unit_loop(_as_plain(self.hmm, self._states), heard)

    def _evidence(self, observed: Observed) -> Evidence:
        inside = self.hmm.inside(observed, self._weights)
        values = self.hmm.log_density(inside, self._states.leaves, self._weights).astype(np.float32)
        column = self._states.column
        return Evidence(
            observed.frames, lambda first, end, chosen: values[first:end, column if chosen is None else column[chosen]]
        )


@dataclass(frozen=True, eq=False)
class _States:
    """The states of all units beside all neighbours that recognition knows.

    table  : names of states in context that differ in any stream from the same state in silence
    leaves : by stream [shape=(C,)], of each different combination
    column : [shape=(len(table.names),)], the combination behind each name
    """

    table: StateTable
    leaves: dict[str, NDArray[np.intp]]
    column: NDArray[np.intp]


def _states(hmm: JointHmm) -> _States:
    inventory = hmm.inventory
    plain: list[Place] = [((inventory.silence, unit, inventory.silence), state) for unit, state in inventory.rows]
    counts = tuple(inventory.count(unit) for unit in inventory.names)
    table = plain_states(inventory.names, counts, inventory.free)
    names: list[str] = []
    places: list[Place] = []
    for unit, state in inventory.rows:
        side = inventory.side(unit, state)
        for neighbour in hmm.spoken if side else ():
            if neighbour not in inventory.free:
                names.append(f"{unit}.{state}{'<' if side < 0 else '>'}{neighbour}")
                places.append((_beside(inventory.silence, unit, neighbour, side), state))
    heard = [name for name in HEARD if name in hmm.parts]
    found = hmm.leaves([*plain, *places])
    rows = np.stack([found[name] for name in heard], axis=1)
    first = np.array([inventory.rows[context[1], state] for context, state in places], np.intp)
    differ = np.flatnonzero((rows[len(plain) :] != rows[first]).any(axis=1))
    kept = np.concatenate([rows[: len(plain)], rows[len(plain) + differ]])
    distinct, column = np.unique(kept, axis=0, return_inverse=True)
    leaves = {name: distinct[:, number] for number, name in enumerate(heard)}
    return _States(table.extended(tuple(names[i] for i in differ)), leaves, column.reshape(-1))


def _beside(silence: str, unit: str, neighbour: str, side: int) -> Context:
    return (neighbour, unit, silence) if side < 0 else (silence, unit, neighbour)


def _as_plain(hmm: JointHmm, states: _States) -> UnitHmm:
    """Return the speech stream alone, as models of units that the loop can be built from."""
    config = HmmConfig(states=hmm.config.states, bigram_weight=hmm.config.bigram_weight, insertion=hmm.config.insertion)
    mixtures = hmm.parts[SPEECH].tied.mixtures.picked(states.leaves[SPEECH][states.column])
    bigram = Bigram(hmm.inventory.names, hmm.bigram.log_probability)
    return UnitHmm(config, states.table, mixtures, hmm.log_stay.astype(np.float32), bigram)
