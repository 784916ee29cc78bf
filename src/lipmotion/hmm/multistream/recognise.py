"""Recognition over a model's own units: the most probable sequence, or sequences drawn from all."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError, InputError
from lipmotion.hmm.decode import UnitLoop, decode_units, unit_loop
from lipmotion.hmm.log_likelihoods import LogLikelihoods
from lipmotion.hmm.model import HmmConfig, UnitHmm
from lipmotion.hmm.multistream.align import StatePath
from lipmotion.hmm.multistream.inventory import Place, states_of
from lipmotion.hmm.multistream.model import JointHmm
from lipmotion.hmm.multistream.streams import HEARD, MOTION, SPEECH, Observed, StreamWeights
from lipmotion.hmm.network import Network
from lipmotion.hmm.states import StateTable, plain_states
from lipmotion.kernels.network import network_posteriors
from lipmotion.kernels.sampling import sample_paths
from lipmotion.stats.bigram import Bigram
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

    def recognise(self, observed: Observed, beam: float | None = None) -> list[Said]:
        """Return the units that were most probably said.

        beam : as in ``stats.hmm.decode.decode_units``; None: exact
        Raises InputError: no stream that is switched on was observed. Raises AlignmentError: too few frames.
        """
        units, starts = decode_units(self._loop, self._evidence(observed), beam)
        return [Said(unit, int(first)) for unit, first in zip(units, starts[:-1], strict=True)]

    def posterior(self, observed: Observed) -> NDArray[np.float64]:
        """Return how probable each state without context is in every frame [shape=(T, R)] (``Inventory.rows``).

        All sequences of units count, each as it is probable. Memory grows with the frames: 20 kB each, in GRID.
        Raises as ``recognise``.
        """
        network = self._loop.network
        found, _, log_likelihood = network_posteriors(self._all_evidence(observed), *_arrays(network))
        _check_found(log_likelihood, observed.frames)
        rows = self._states.rows[network.emission]
        result = np.zeros((observed.frames, len(self.hmm.inventory.rows)))
        np.add.at(result.T, rows, found.T.astype(float))
        return result

    def sampled_paths(self, observed: Observed, count: int, seed: int) -> list[StatePath]:
        """Return paths of states, drawn from all that there may have been, each as often as it is probable.

        Memory grows with the frames, as in ``posterior``. Raises as ``recognise``.
        """
        if count < 1:
            raise InputError(f"{count} paths, required one or more")
        uniform = np.random.default_rng(seed).random((count, observed.frames))
        network = self._loop.network
        paths, log_likelihood = sample_paths(self._all_evidence(observed), *_arrays(network), uniform)
        _check_found(log_likelihood, observed.frames)
        return [self._path(nodes) for nodes in paths]

    def sampled(self, observed: Observed, count: int, seed: int) -> list[list[Said]]:
        """Return sequences of units, those of ``sampled_paths``."""
        found = []
        for path in self.sampled_paths(observed, count, seed):
            units = [context[1] for (context, state) in path.states.places if state == 0]
            firsts = path.bounds(len(units))[:-1].tolist()
            found.append([Said(unit, first) for unit, first in zip(units, firsts, strict=True)])
        return found

    def _path(self, nodes: NDArray[np.intp]) -> StatePath:
        """Return a path through the loop as one through the states of its units: every new node is the next state."""
        changes = np.append(True, np.diff(nodes) != 0)
        entered = [int(node) for node in nodes[changes] if int(node) in self._loop.entries]
        units = [self._loop.owners[node] for node in entered]
        return StatePath(states_of(self.hmm.inventory, units), np.cumsum(changes) - 1)

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

    def _evidence(self, observed: Observed) -> LogLikelihoods:
        inside = self.hmm.inside(observed, self._weights)

        def log_density(first: int, end: int, chosen: NDArray[np.intp] | None) -> NDArray[np.float32]:
            rows = {name: stream[first:end] for name, stream in inside.items()}
            values = self.hmm.log_density(rows, self._states.leaves, self._weights).astype(np.float32)
            return values[:, self._states.column if chosen is None else self._states.column[chosen]]

        return LogLikelihoods(observed.frames, log_density)

    def _all_evidence(self, observed: Observed) -> NDArray[np.float32]:
        return self._evidence(observed).log_density(0, observed.frames, None)


_Arrays = tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]


def _arrays(network: Network) -> _Arrays:
    arcs = network.arc_from, network.arc_log, network.arc_start
    return network.emission, *arcs, network.log_initial, network.log_final


def _check_found(log_likelihood: float, frames: int) -> None:
    if not np.isfinite(log_likelihood):
        raise AlignmentError(f"no units fit into {frames} frames of 10 ms; give a longer recording")


@dataclass(frozen=True, eq=False)
class _States:
    """The states of all units beside all neighbours that recognition knows.

    table  : names of states in context that differ in any stream from the same state in silence
    leaves : by stream [shape=(C,)], of each different combination
    column : [shape=(len(table.names),)], the combination behind each name
    rows   : [shape=(len(table.names),)], the state without context behind it
    """

    table: StateTable
    leaves: dict[str, NDArray[np.intp]]
    column: NDArray[np.intp]
    rows: NDArray[np.intp]


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
    extended = table.extended(tuple(names[i] for i in differ))
    return _States(extended, leaves, column.reshape(-1), np.concatenate([np.arange(len(plain)), first[differ]]))


def _beside(silence: str, unit: str, neighbour: str, side: int) -> Context:
    return (neighbour, unit, silence) if side < 0 else (silence, unit, neighbour)


def _as_plain(hmm: JointHmm, states: _States) -> UnitHmm:
    """Return the speech stream alone, as models of units that the loop can be built from."""
    config = HmmConfig(states=hmm.config.states, bigram_weight=hmm.config.bigram_weight, insertion=hmm.config.insertion)
    mixtures = hmm.parts[SPEECH].tied.mixtures.picked(states.leaves[SPEECH][states.column])
    bigram = Bigram(hmm.inventory.names, hmm.bigram.log_probability)
    return UnitHmm(config, states.table, mixtures, hmm.log_stay.astype(np.float32), bigram)


@lru_cache(maxsize=4)
def joint_recogniser(hmm: JointHmm) -> JointRecogniser:
    """Return the recogniser of a model; the last few are kept with the networks that they search."""
    return JointRecogniser(hmm)
