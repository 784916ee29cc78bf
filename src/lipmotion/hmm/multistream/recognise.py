"""Recognition with multi-stream models: the most probable unit sequence, or paths drawn from the posterior."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError, InputError
from lipmotion.hmm.decode import UnitLoop, decode_units, unit_loop
from lipmotion.hmm.log_likelihoods import LogLikelihoods
from lipmotion.hmm.model import HmmConfig, UnitHmm
from lipmotion.hmm.multistream.align import StatePath
from lipmotion.hmm.multistream.model import JointHmm
from lipmotion.hmm.multistream.streams import ACOUSTIC_STREAMS, MOTION, SPEECH, StreamObservations, StreamWeights
from lipmotion.hmm.multistream.unit_states import TriphoneState, triphone_states
from lipmotion.hmm.states import StateTable, plain_states
from lipmotion.kernels.sequences.sampling import sample_paths
from lipmotion.stats.bigram import Bigram
from lipmotion.stats.trees import Context


class RecognisedUnit(NamedTuple):
    """A recognised unit, and its first frame."""

    unit: str
    first: int


@dataclass(frozen=True, eq=False)
class JointRecogniser:
    """Recogniser that searches the loop of all units that occurred in training, in context, with the back-off bigram.

    hmm     : the models
    weights : of the streams; None: those of recognition
    The search is exact, as trees of acoustic streams ask about one neighbour only. Where units have one state, a unit
    spoken twice in a row is recognised once.
    Raises InputError: the weight of motion is not 0; its trees ask about both neighbours.
    Source: Hofer 2008, Eq. 5.
    """

    hmm: JointHmm
    weights: StreamWeights | None = None

    def __post_init__(self) -> None:
        if MOTION in self._weights.active:
            raise InputError("recognition uses no motion: give the stream motion the weight 0")

    def recognise(self, observed: StreamObservations, beam: float | None = None) -> list[RecognisedUnit]:
        """Return the most probable sequence of units, in order.

        beam : as in ``hmm.decode.decode_units``; None: exact
        Raises InputError: no active stream was observed. Raises AlignmentError: too few frames.
        """
        units, starts = decode_units(self._loop, self._log_likelihoods(observed), beam)
        return [RecognisedUnit(unit, int(first)) for unit, first in zip(units, starts[:-1], strict=True)]

    def sampled_paths(self, observed: StreamObservations, count: int, seed: int) -> list[StatePath]:
        """Return ``count`` paths of states, drawn independently from the posterior of all paths.

        Memory grows with the frames: 20 kB each, in GRID. Raises as ``recognise``.
        """
        if count < 1:
            raise InputError(f"{count} paths, required one or more")
        uniform = np.random.default_rng(seed).random((count, observed.frames))
        log_density = self._log_likelihoods(observed).log_density(0, observed.frames, None)
        paths, log_likelihood = sample_paths(log_density, self._loop.network.arrays, uniform)
        if not np.isfinite(log_likelihood):
            raise AlignmentError(f"no units fit into {observed.frames} frames of 10 ms; give a longer recording")
        return [self._path(nodes) for nodes in paths]

    def _path(self, nodes: NDArray[np.intp]) -> StatePath:
        """Return a path through the nodes of the loop as a path through the states of its units, one state a node."""
        changes = np.append(True, np.diff(nodes) != 0)
        entered = [int(node) for node in nodes[changes] if int(node) in self._loop.entries]
        units = [self._loop.owners[node] for node in entered]
        return StatePath(triphone_states(self.hmm.inventory, units), np.cumsum(changes) - 1)

    @property
    def _weights(self) -> StreamWeights:
        return self.weights or self.hmm.config.recognition

    @cached_property
    def _states(self) -> _LoopStates:
        return _loop_states(self.hmm)

    @cached_property
    def _loop(self) -> UnitLoop:
        inventory = self.hmm.inventory
        units = [unit for unit in self.hmm.spoken if unit not in inventory.free[1:]]
        return unit_loop(_unit_hmm(self.hmm, self._states), units)

    def _log_likelihoods(self, observed: StreamObservations) -> LogLikelihoods:
        streams = self.hmm.standardise(observed, self._weights)

        def log_density(first: int, end: int, chosen: NDArray[np.intp] | None) -> NDArray[np.float32]:
            rows = {name: stream[first:end] for name, stream in streams.items()}
            values = self.hmm.log_density(rows, self._states.leaves, self._weights).astype(np.float32)
            return values[:, self._states.column if chosen is None else self._states.column[chosen]]

        return LogLikelihoods(observed.frames, log_density)


@dataclass(frozen=True, eq=False)
class _LoopStates:
    """The states of all units in all contexts that recognition searches.

    table  : G states: all without context, then those in context whose leaves differ from those of the same state
             beside silence in any stream
    leaves : by stream, the leaves of each distinct combination [shape=(C,)]
    column : [shape=(G,)], the number of each state's combination of leaves
    """

    table: StateTable
    leaves: dict[str, NDArray[np.intp]]
    column: NDArray[np.intp]


def _loop_states(hmm: JointHmm) -> _LoopStates:
    """Return the states that the loop of a model's units consists of."""
    inventory = hmm.inventory
    plain: list[TriphoneState] = [
        ((inventory.silence, unit, inventory.silence), state) for unit, state in inventory.monophones
    ]
    counts = tuple(inventory.count(unit) for unit in inventory.names)
    table = plain_states(inventory.names, counts, inventory.free)
    names: list[str] = []
    triphones: list[TriphoneState] = []
    for unit, state in inventory.monophones:
        side = inventory.side(unit, state)
        for neighbour in hmm.spoken if side else ():
            if neighbour not in inventory.free:
                names.append(f"{unit}.{state}{'<' if side < 0 else '>'}{neighbour}")
                triphones.append((_context(inventory.silence, unit, neighbour, side), state))
    acoustic = [name for name in ACOUSTIC_STREAMS if name in hmm.models]
    leaves_of_all = hmm.leaves([*plain, *triphones])
    rows = np.stack([leaves_of_all[name] for name in acoustic], axis=1)
    monophones = np.array([inventory.monophones[context[1], state] for context, state in triphones], np.intp)
    different = np.flatnonzero((rows[len(plain) :] != rows[monophones]).any(axis=1))
    combinations = np.concatenate([rows[: len(plain)], rows[len(plain) + different]])
    distinct, column = np.unique(combinations, axis=0, return_inverse=True)
    leaves = {name: distinct[:, number] for number, name in enumerate(acoustic)}
    return _LoopStates(table.extended(tuple(names[i] for i in different)), leaves, column.reshape(-1))


def _context(silence: str, unit: str, neighbour: str, side: int) -> Context:
    return (neighbour, unit, silence) if side < 0 else (silence, unit, neighbour)


def _unit_hmm(hmm: JointHmm, states: _LoopStates) -> UnitHmm:
    """Return unit models with the densities of the speech stream, from which the loop is built."""
    config = HmmConfig(states=hmm.config.states, bigram_weight=hmm.config.bigram_weight, insertion=hmm.config.insertion)
    mixtures = hmm.models[SPEECH].tied.mixtures.selected(states.leaves[SPEECH][states.column])
    bigram = Bigram(hmm.inventory.names, hmm.bigram.log_probability)
    return UnitHmm(config, states.table, mixtures, hmm.log_stay.astype(np.float32), bigram)


@lru_cache(maxsize=4)
def joint_recogniser(hmm: JointHmm) -> JointRecogniser:
    """Return the recogniser of a model; the last few recognisers, with their networks, are cached."""
    return JointRecogniser(hmm)
