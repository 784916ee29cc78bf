"""Trained unit models, and their serialisation as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.states import StateTable, plain_states
from lipmotion.stats.bigram import BIGRAM, Bigram, bigram_from_array
from lipmotion.stats.mixture import MIXTURES, Mixtures, mixtures_from_arrays
from lipmotion.storage.schema import NEGATIVE, Arrays, ArraySpec, check_arrays, format_errors, refuse_undeclared
from lipmotion.types import Configuration


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

    log_stay    : float32 array [shape=(G,)], log P(stay in the state), of the states without context
    typical_fit : mean ``fit`` of the recordings that the models were trained on
    """

    config: HmmConfig
    table: StateTable
    mixtures: Mixtures
    log_stay: NDArray[np.float32]
    bigram: Bigram
    typical_fit: float = 0.0

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


def hmm_arrays(hmm: UnitHmm, precision: type[np.floating[Any]] = np.float16) -> dict[str, NDArray[Any]]:
    """Serialise the models; the configuration is not included.

    precision : of the Gaussians: half precision suffices for recognition, float32 keeps them exactly
    """
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
    }


def hmm_from_arrays(arrays: Arrays, config: HmmConfig) -> UnitHmm:
    """Deserialise models. Raises ModelFormatError: an array is missing, undeclared, inconsistent or out of range."""
    with format_errors("the phone models", "train or download the model again", verb="are"):
        refuse_undeclared(arrays, NAMES, MODELS)
        named = check_arrays(arrays, NAMES)
        units, counts, names, free = (tuple(named[key].tolist()) for key in ("units", "counts", "names", "free"))
        _check_names(units, counts, names, free)
        stored = check_arrays(arrays, MODELS, **named.sizes, R=sum(counts))
        table = StateTable(units, counts, names, free)
        bigram = bigram_from_array(units, stored["bigram"])
        return UnitHmm(
            config, table, mixtures_from_arrays(stored), stored["log_stay"], bigram, float(stored["typical_fit"][0])
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
}
"""How unit models are stored: G states, R of them without context."""


def _check_names(
    units: tuple[str, ...], counts: tuple[int, ...], names: tuple[str, ...], free: tuple[str, ...]
) -> None:
    if not set(free) <= set(units) or len(set(units)) < len(units) or sum(counts) > len(names):
        raise ValueError(f"{len(names)} states of {len(units)} units, {len(free)} of them silent")
    required = plain_states(units, counts, free).names
    if names[: len(required)] != required or len(set(names)) < len(names):
        raise ValueError("the names of the states are not those of the units")
