"""Trained unit models: the table of tied states, their densities, and their serialisation as arrays."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.stats.bigram import BIGRAM, Bigram, bigram_from_array
from lipmotion.stats.mixture import MIXTURES, Mixtures, mixtures_from_arrays
from lipmotion.storage.schema import NEGATIVE, Arrays, ArraySpec, check_arrays, format_errors, refuse_undeclared
from lipmotion.types import Configuration


@dataclass(frozen=True)
class StateTable:
    """The tied states of an inventory of units.

    States before a unit's middle depend on the unit to the left, those after it on the one to the right, and
    the middle one (of an odd count) on neither: so whole sequences of context-dependent units can be searched
    exactly with units² nodes instead of units³. A state in a context too rare to be modelled is that without context.

    names    : of all densities: ``b.0`` (no context), ``b.0<ih`` (left), ``b.2>ih`` (right)
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
        """Return the number of states of a unit."""
        return self.counts[self.units.index(unit)]

    def side(self, unit: str, state: int) -> str:
        """Return ``<`` for a state that depends on the left neighbour, ``>`` on the right one, "" on none."""
        count = self.count(unit)
        if unit in self.free or 2 * state + 1 == count:
            return ""
        return "<" if 2 * state + 1 < count else ">"

    def name(self, left: str, unit: str, right: str, state: int) -> str:
        """Return the full name of a state in its context, whether or not it has a density of its own."""
        side = self.side(unit, state)
        return f"{unit}.{state}" + (side + {"<": left, ">": right}[side] if side else "")

    def density(self, unit: str, state: int, neighbour: str = "") -> int:
        """Return the density of a state beside a neighbour, or the one without context where there is none for it."""
        plain = f"{unit}.{state}"
        in_context = f"{plain}{self.side(unit, state)}{neighbour}" if neighbour else plain
        return self._index.get(in_context, self._index[plain])

    def parents(self) -> NDArray[np.intp]:
        """Return the density without context of the same state, for every density [shape=(G,)]."""
        return np.array([self._index[re.split("[<>]", name)[0]] for name in self.names], np.intp)


def make_plain_states(units: tuple[str, ...], counts: tuple[int, ...], free: tuple[str, ...]) -> StateTable:
    """Return the table of states without context."""
    names = tuple(f"{unit}.{state}" for unit, count in zip(units, counts, strict=True) for state in range(count))
    return StateTable(units, counts, names, free)


@dataclass(frozen=True)
class HmmConfig(Configuration):
    """How unit models are built and trained.

    states       : states per unit, left to right, no skips
    mixtures     : most Gaussians per state (a power of two); fewer are used with little speech
    context_frames : frames of data that a state in context needs for a density of its own
    relevance    : weight of the density without context as a prior, in frames per Gaussian
    iterations   : embedded Baum–Welch iterations per stage
    variance_floor   : least variance, as a share of a feature's overall variance
    bigram_weight, insertion : scale of the log bigram, and log insertion penalty of every unit, in decoding
    """

    states: int = 3
    mixtures: int = 8
    context_frames: int = 30
    relevance: float = 10.0
    iterations: int = 4
    variance_floor: float = 0.02
    bigram_weight: float = 4.0
    insertion: float = -4.0


@dataclass(frozen=True, eq=False)
class UnitHmm:
    """Models of all units: tied states, their densities, how long each lasts, and which unit follows which.

    log_stay    : float32 array [shape=(R,)], log P(stay in the state), of the states without context
    typical_fit : mean ``fit`` of the recordings that the models were trained on
    speaker     : mean speaker vector of these recordings (``speech.sound.speaker_similarity``) [shape=(128,)];
                  None: a model of an earlier version
    """

    config: HmmConfig
    table: StateTable
    mixtures: Mixtures
    log_stay: NDArray[np.float32]
    bigram: Bigram
    typical_fit: float = 0.0
    speaker: NDArray[np.float32] | None = None

    def __repr__(self) -> str:
        densities, components, features = self.mixtures.size
        return f"UnitHmm({densities} densities of {components} components, {features} features)"

    def stay(self, unit: str, state: int) -> float:
        """Return log P(stay in this state)."""
        return float(self.log_stay[self.table.density(unit, state)])

    def move(self, unit: str, state: int) -> float:
        """Return log P(leave this state)."""
        return float(np.log(-np.expm1(self.stay(unit, state))))

    def fit(self, features: NDArray[np.float32]) -> float:
        """Return the mean over frames [shape=(T, D)] of the highest log density of any state without context."""
        plain = np.arange(len(self.log_stay), dtype=np.intp)
        return float(self.mixtures.log_likelihood(features, plain).max(axis=1).mean())


def hmm_to_arrays(hmm: UnitHmm, precision: type[np.floating[Any]] = np.float16) -> dict[str, NDArray[Any]]:
    """Serialise the models; the configuration is not included."""
    return {
        "units": np.array(hmm.table.units),
        "counts": np.array(hmm.table.counts, np.int32),
        "names": np.array(hmm.table.names),
        "free": np.array(hmm.table.free),
        "log_weights": hmm.mixtures.log_weights.astype(precision),
        "means": hmm.mixtures.means.astype(precision),
        "variances": hmm.mixtures.variances.astype(precision),
        "log_stay": hmm.log_stay,
        "bigram": hmm.bigram.log_probability,
        "typical_fit": np.array([hmm.typical_fit]),
        **({} if hmm.speaker is None else {"speaker": hmm.speaker.astype(precision)}),
    }


def hmm_from_arrays(arrays: Arrays, config: HmmConfig) -> UnitHmm:
    """Deserialise models. Raises ModelFormatError: an array is missing, undeclared, inconsistent or out of range."""
    with format_errors("the phone models", "train or download the model again", verb="are"):
        refuse_undeclared(arrays, NAMES, MODELS)
        named = check_arrays(arrays, NAMES)
        units, counts, names, free = (tuple(named[key].tolist()) for key in ("units", "counts", "names", "free"))
        if not set(free) <= set(units) or len(set(units)) < len(units) or sum(counts) > len(names):
            raise ValueError(f"{len(names)} states of {len(units)} units, {len(free)} of them silent")
        required = make_plain_states(units, counts, free).names
        if names[: len(required)] != required or len(set(names)) < len(names):
            raise ValueError("the names of the states are not those of the units")
        stored = check_arrays(arrays, MODELS, **named.sizes, R=sum(counts))
        table = StateTable(units, counts, names, free)
        bigram = bigram_from_array(units, stored["bigram"])
        return UnitHmm(
            config,
            table,
            mixtures_from_arrays(stored),
            stored["log_stay"],
            bigram,
            float(stored["typical_fit"][0]),
            stored["speaker"] if "speaker" in arrays else None,
        )


NAMES = {
    "units": ArraySpec(np.str_, "U"),
    "counts": ArraySpec(np.int32, "U", 1, 1000),
    "names": ArraySpec(np.str_, "G"),
    "free": ArraySpec(np.str_, "F"),
}
MODELS = {
    **MIXTURES,
    **BIGRAM,
    "log_stay": ArraySpec(np.float32, "R", -1e4, NEGATIVE),
    "typical_fit": ArraySpec(np.float64, "1", -1e6, 1e6),
    "speaker": ArraySpec(np.float32, "128", -1e4, 1e4, optional=True),
}
"""How unit models are stored: G states, R of them without context."""
