"""Multi-stream hidden Markov models: one set of states, with densities for each stream of data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.hmm.multistream.densities import StreamScale, TiedDensities
from lipmotion.hmm.multistream.forest import Forest
from lipmotion.hmm.multistream.streams import StreamObservations, StreamWeights
from lipmotion.hmm.multistream.unit_states import Inventory, TriphoneState
from lipmotion.printable import printable
from lipmotion.stats.bigram import Bigram

ACOUSTIC_ONLY = StreamWeights(motion=0.0)
MOTION_ONLY = StreamWeights(0.0, 0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class JointConfig:
    """How a joint model is built, trained and used.

    states       : states per unit, left to right, no skips
    mixtures, motion_mixtures : most Gaussians per state of speech, and of motion (powers of two)
    plain_iterations, iterations : embedded Baum–Welch iterations without context, and in every later stage
    both_neighbours : trees of speech and F0 ask about both neighbours in every state, not about one
    tree_factor  : price of a leaf, in units of its description length
    least_frames : frames that a leaf must have
    variance_floor : least variance, as a share of a dimension's overall variance
    bigram_weight, insertion : scale of the log bigram, and log insertion penalty of every unit, in recognition
    training, recognition, synthesis : weights of the streams in each
    Raises InputError: a number out of its range.
    """

    states: int = 3
    mixtures: int = 16
    motion_mixtures: int = 1
    plain_iterations: int = 6
    iterations: int = 4
    both_neighbours: bool = False
    tree_factor: float = 1.0
    least_frames: float = 30.0
    variance_floor: float = 0.02
    bigram_weight: float = 4.0
    insertion: float = -4.0
    training: StreamWeights = field(default=StreamWeights())
    recognition: StreamWeights = field(default=ACOUSTIC_ONLY)
    synthesis: StreamWeights = field(default=MOTION_ONLY)

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if each.type == "int" and (not isinstance(value, int) or value < 1):
                raise InputError(f"{each.name} is {value!r}, required a whole number from 1")
            if each.type == "float" and not np.isfinite(value):
                raise InputError(f"{each.name} is {value}, required a finite number")
        if min(self.tree_factor, self.least_frames, self.variance_floor) <= 0:
            raise InputError("tree_factor, least_frames and variance_floor must be more than 0")
        if not self.training.active:
            raise InputError("all streams are switched off in training; give at least one a weight")


@dataclass(frozen=True, eq=False)
class StreamModel:
    """The model of one stream: its scale, the trees that tie its states, and the densities of their leaves."""

    scale: StreamScale
    forest: Forest
    tied: TiedDensities


@dataclass(frozen=True, eq=False)
class JointHmm:
    """Models of all units, in several streams that share their transitions.

    models    : of each stream, by name
    log_stay  : [shape=(R,)], log P(stay in the state) of every state without context (``Inventory.monophones``)
    durations : [shape=(R, 2)], mean and variance of each state's duration in the training's alignment, in frames
    spoken    : the units that occurred in training: those that recognition searches
    """

    config: JointConfig
    inventory: Inventory
    models: Mapping[str, StreamModel]
    log_stay: NDArray[np.float64]
    durations: NDArray[np.float64]
    spoken: tuple[str, ...]
    bigram: Bigram

    def standardise(self, observed: StreamObservations, weights: StreamWeights) -> dict[str, NDArray[np.float32]]:
        """Return the active streams, standardised by their scales (``StreamScale.standardise``).

        Raises InputError: none of them was observed, or one has other dimensions than the model's.
        """
        active = [name for name in weights.active if name in observed.streams and name in self.models]
        if not active:
            raise InputError(
                f"switched on are {', '.join(weights.active) or 'no streams'}; "
                f"of the model's {', '.join(self.models)} were observed {', '.join(observed.streams)}"
            )
        for name in active:
            observed_size, required = observed.streams[name].values.shape[1], len(self.models[name].scale.mean)
            if observed_size != required:
                raise InputError(f"the stream {name} has {observed_size} dimensions, the model's has {required}")
        return {name: self.models[name].scale.standardise(observed.streams[name]) for name in active}

    def leaves(self, triphones: Sequence[TriphoneState]) -> dict[str, NDArray[np.intp]]:
        """Return the leaves of states in context, by stream [shape=(S,)]."""
        return {name: model.forest.leaves(triphones) for name, model in self.models.items()}

    def log_density(
        self, streams: Mapping[str, NDArray[np.float32]], leaves: Mapping[str, NDArray[np.intp]], weights: StreamWeights
    ) -> NDArray[np.float64]:
        """Return the weighted sum of the streams' log densities of S states in every frame [shape=(T, S)].

        streams : from ``standardise``
        leaves  : of the states, in each stream [shape=(S,)]
        """
        total = np.zeros((1, 1))
        for name, rows in streams.items():
            model = self.models[name]
            values = model.tied.log_density(rows, leaves[name], model.scale.log_determinant)
            total = total + weights.active[name] * values.astype(float)
        return total

    @property
    def log_move(self) -> NDArray[np.float64]:
        """Log P(leave the state) of every state without context [shape=(R,)]."""
        return np.log(-np.expm1(self.log_stay))

    def text(self) -> str:
        """Return the trees of all streams as readable text."""
        forests = {name: model.forest for name, model in self.models.items()}
        return "\n\n".join(
            f"{printable(name)}: {forest.size} leaves\n{forest.text()}" for name, forest in forests.items()
        )
