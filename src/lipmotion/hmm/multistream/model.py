"""A trained joint model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.hmm.multistream.densities import Scale, Tied
from lipmotion.hmm.multistream.forest import Forest
from lipmotion.hmm.multistream.inventory import Inventory, Place
from lipmotion.hmm.multistream.streams import Observed, StreamWeights
from lipmotion.printable import printable
from lipmotion.stats.bigram import Bigram

HEARD_ONLY = StreamWeights(motion=0.0)
MOTION_ONLY = StreamWeights(0.0, 0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class JointConfig:
    """How a joint model is built, trained and used.

    states       : states per unit, left to right, no skips
    mixtures, motion_mixtures : most Gaussians per state of speech, and of motion (powers of two)
    plain_iterations, iterations : embedded Baum–Welch iterations without context, and in every later stage
    tree_factor  : price of a leaf, in units of its description length
    least_frames : frames that a leaf must have
    variance_floor : share of a dimension's overall variance
    bigram_weight, insertion : scale of the log bigram, and log price of every unit, when recognising
    training, recognition, synthesis : weights of the streams in each
    Raises InputError: a number out of its range.
    """

    states: int = 3
    mixtures: int = 16
    motion_mixtures: int = 1
    plain_iterations: int = 6
    iterations: int = 4
    tree_factor: float = 1.0
    least_frames: float = 30.0
    variance_floor: float = 0.02
    bigram_weight: float = 4.0
    insertion: float = -4.0
    training: StreamWeights = field(default=StreamWeights())
    recognition: StreamWeights = field(default=HEARD_ONLY)
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
        if not self.training.on:
            raise InputError("all streams are switched off in training; give at least one a weight")


@dataclass(frozen=True, eq=False)
class Part:
    """What a model knows of one stream: its scale, the trees that tie its states, and the densities of their leaves."""

    scale: Scale
    forest: Forest
    tied: Tied


@dataclass(frozen=True, eq=False)
class JointHmm:
    """Models of all units, of several streams that share their transitions.

    parts     : by stream
    log_stay  : [shape=(R,)], log P(keep the state) of every state without context (``Inventory.rows``)
    durations : [shape=(R, 2)], mean and variance of the frames that each state lasted in the training's alignment
    spoken    : the units that were heard in training: those that recognition looks for
    """

    config: JointConfig
    inventory: Inventory
    parts: Mapping[str, Part]
    log_stay: NDArray[np.float64]
    durations: NDArray[np.float64]
    spoken: tuple[str, ...]
    bigram: Bigram

    def inside(self, observed: Observed, weights: StreamWeights) -> dict[str, NDArray[np.float32]]:
        """Return the streams that are switched on, as their densities take them (``Scale.inside``).

        Raises InputError: none of them was observed, or one has other dimensions than the model's.
        """
        on = [name for name in weights.on if name in observed.streams and name in self.parts]
        if not on:
            raise InputError(
                f"switched on are {', '.join(weights.on) or 'no streams'}; "
                f"of the model's {', '.join(self.parts)} were observed {', '.join(observed.streams)}"
            )
        for name in on:
            found, required = observed.streams[name].values.shape[1], len(self.parts[name].scale.mean)
            if found != required:
                raise InputError(f"the stream {name} has {found} dimensions, the model's has {required}")
        return {name: self.parts[name].scale.inside(observed.streams[name]) for name in on}

    def leaves(self, places: Sequence[Place]) -> dict[str, NDArray[np.intp]]:
        """Return the leaves of states in their contexts, by stream [shape=(S,)]."""
        return {name: part.forest.leaves(places) for name, part in self.parts.items()}

    def log_density(
        self, inside: Mapping[str, NDArray[np.float32]], leaves: Mapping[str, NDArray[np.intp]], weights: StreamWeights
    ) -> NDArray[np.float64]:
        """Return the weighted sum of the streams' log densities of S states in every frame [shape=(T, S)].

        inside : from ``inside``
        leaves : of each stream [shape=(S,)]
        """
        total = np.zeros((1, 1))
        for name, rows in inside.items():
            part = self.parts[name]
            values = part.tied.log_density(rows, leaves[name], part.scale.log_volume)
            total = total + weights.on[name] * values.astype(float)
        return total

    @property
    def log_move(self) -> NDArray[np.float64]:
        """Log P(leave the state) [shape=(R,)]."""
        return np.log(-np.expm1(self.log_stay))

    def text(self) -> str:
        """Return the trees of all streams for people to read."""
        forests = {name: part.forest for name, part in self.parts.items()}
        return "\n\n".join(
            f"{printable(name)}: {forest.size} leaves\n{forest.text()}" for name, forest in forests.items()
        )
