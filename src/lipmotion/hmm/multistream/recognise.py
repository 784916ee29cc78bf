"""Recognition with multi-stream models: the most probable unit sequence, or paths drawn from the posterior."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError, InputError
from lipmotion.hmm.decode import decode_units
from lipmotion.hmm.log_likelihoods import LogLikelihoods
from lipmotion.hmm.multistream.align import StatePath
from lipmotion.hmm.multistream.context_loop import ContextLoop, context_loop
from lipmotion.hmm.multistream.model import JointHmm
from lipmotion.hmm.multistream.streams import MOTION, StreamObservations, StreamWeights
from lipmotion.hmm.multistream.unit_states import triphone_states
from lipmotion.kernels.sequences.sampling import sample_paths


class RecognisedUnit(NamedTuple):
    """A recognised unit, and its first frame."""

    unit: str
    first: int


@dataclass(frozen=True, eq=False)
class JointRecogniser:
    """Recogniser that searches the loop of all units that occurred in training, in context, with the back-off bigram.

    hmm     : the models
    weights : of the streams; None: those of recognition
    The search is exact, whether trees of acoustic streams ask about one neighbour or both. Where units have one state,
    a unit spoken twice in a row is recognised once.
    Raises InputError: the weight of motion is not 0.
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
        units, starts = decode_units(self._loop.network, self._log_likelihoods(observed), beam)
        return [RecognisedUnit(unit, int(first)) for unit, first in zip(units, starts[:-1], strict=True)]

    def sampled_paths(self, observed: StreamObservations, count: int, seed: int) -> list[StatePath]:
        """Return ``count`` paths of states, drawn independently from the posterior of all paths.

        Memory grows with the frames: 20 kB each, in GRID. Raises as ``recognise``.
        """
        if count < 1:
            raise InputError(f"{count} paths, required one or more")
        uniform = np.random.default_rng(seed).random((count, observed.frames))
        log_density = self._log_likelihoods(observed).log_density(0, observed.frames, None)
        paths, log_likelihood = sample_paths(log_density, self._loop.network.network.arrays, uniform)
        if not np.isfinite(log_likelihood):
            raise AlignmentError(f"no units fit into {observed.frames} frames of 10 ms; give a longer recording")
        return [self._path(nodes) for nodes in paths]

    def _path(self, nodes: NDArray[np.intp]) -> StatePath:
        """Return a path through the nodes of the loop as a path through the states of its units, one state a node."""
        changes, loop = np.append(True, np.diff(nodes) != 0), self._loop.network
        units = [loop.owners[node] for node in nodes[changes].tolist() if node in loop.entries]
        return StatePath(triphone_states(self.hmm.inventory, units), np.cumsum(changes) - 1)

    @property
    def _weights(self) -> StreamWeights:
        return self.weights or self.hmm.config.recognition

    @cached_property
    def _loop(self) -> ContextLoop:
        return context_loop(self.hmm)

    def _log_likelihoods(self, observed: StreamObservations) -> LogLikelihoods:
        streams = self.hmm.standardise(observed, self._weights)

        def log_density(first: int, end: int, chosen: NDArray[np.intp] | None) -> NDArray[np.float32]:
            rows = {name: stream[first:end] for name, stream in streams.items()}
            values = self.hmm.log_density(rows, self._loop.leaves, self._weights).astype(np.float32)
            return values if chosen is None else values[:, chosen]

        return LogLikelihoods(observed.frames, log_density)


@lru_cache(maxsize=4)
def joint_recogniser(hmm: JointHmm) -> JointRecogniser:
    """Return the recogniser of a model; the last few recognisers, with their networks, are cached."""
    return JointRecogniser(hmm)
