"""A trained set of unit models."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ModelFormatError
from lipmotion.stats.bigram import Bigram
from lipmotion.stats.hmm.states import StateTable
from lipmotion.stats.mixture import Mixtures

LOUD_SILENCE = 8.0
"""What the log density of silence loses in a loud frame."""


@dataclass(frozen=True)
class HmmConfig:
    """How unit models are built and trained.

    states       : states per unit, left to right, no skips
    mixtures     : Gaussians per state (a power of two)
    context_frames : least frames of data for a state in context to get a density of its own
    relevance    : frames that the density without context counts for, per Gaussian, in one with context
    iterations   : embedded Baum–Welch iterations per stage
    variance_floor   : share of a feature's overall variance
    bigram_weight, insertion : scale of the log bigram, and log price of every unit, when decoding
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

    log_stay : float32 array [shape=(G,)], of the densities without context; log P(keep the state)
    """

    config: HmmConfig
    table: StateTable
    mixtures: Mixtures
    log_stay: NDArray[np.float32]
    bigram: Bigram

    def stay(self, unit: str, state: int) -> float:
        """Return log P(keep this state one frame longer)."""
        return float(self.log_stay[self.table.density(unit, state)])

    def move(self, unit: str, state: int) -> float:
        """Return log P(leave this state)."""
        return float(np.log(-np.expm1(self.stay(unit, state))))

    def log_emission(
        self, features: NDArray[np.float32], chosen: NDArray[np.intp], loud: NDArray[np.bool_] | None
    ) -> NDArray[np.float32]:
        """Return the log density of every frame under some densities [shape=(T, G')], for forced alignment.

        features : [shape=(T, D)]
        chosen   : [shape=(G',)], the densities wanted
        loud     : [shape=(T,)], frames that cannot be silence. A voice that the models do not know is, to them,
                   hardly more like speech than like silence; its energy says which
        """
        log_density = self.mixtures.log_likelihood(features, chosen)
        if loud is not None:
            free = [self.table.density(unit, k) for unit in self.table.free for k in range(self.table.count(unit))]
            log_density[np.ix_(loud, np.isin(chosen, free))] -= LOUD_SILENCE
        return log_density


def hmm_arrays(hmm: UnitHmm, precision: type[np.floating[Any]] = np.float16) -> dict[str, NDArray[Any]]:
    """Return the models as arrays; the configuration is not among them.

    precision : of the Gaussians: half is enough to recognise with, float32 is all there is
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
    }


def hmm_from_arrays(arrays: Mapping[str, NDArray[Any]], config: HmmConfig) -> UnitHmm:
    """Return the models again. Raises ModelFormatError: something is missing or has the wrong shape."""
    try:
        units, counts, names, free = (arrays[key].tolist() for key in ("units", "counts", "names", "free"))
        _check_shapes(arrays)
        table = StateTable(tuple(units), tuple(counts), tuple(names), tuple(free))
        mixtures = Mixtures(*(arrays[key].astype(np.float32) for key in ("log_weights", "means", "variances")))
        bigram = Bigram(table.units, arrays["bigram"].astype(np.float32))
        return UnitHmm(config, table, mixtures, arrays["log_stay"].astype(np.float32), bigram)
    except (KeyError, ValueError) as error:
        raise ModelFormatError(f"the phone models are damaged ({error}); train or download the model again") from error


def _check_shapes(arrays: Mapping[str, NDArray[Any]]) -> None:
    units, densities = len(arrays["units"]), len(arrays["names"])
    each = (densities, *arrays["means"].shape[1:])
    required = {
        "counts": (units,),
        "bigram": (units, units),
        "log_stay": (int(arrays["counts"].sum()),),
        "log_weights": each[:2],
        "means": each,
        "variances": each,
    }
    for name, shape in required.items():
        if arrays[name].shape != shape:
            raise ValueError(f"{name} of shape {arrays[name].shape}, required {shape}")
