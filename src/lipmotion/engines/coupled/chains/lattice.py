"""The part of a product in which a recording can be, and inference there."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import Single

Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Lattice(ABC):
    """Some joint states of a product; probabilities are those of the whole.

    counts    : which of the numbers that transitions are learned from it can tell [shape=(C',)]
    densities : those needed of each group [each shape=(G',)]
    ties      : for each group, the position there of the density of each joint state [each shape=(S',)]
    spoken    : the unit of the first chain behind each density of the first group [shape=(G',)]
    allowed   : the units that may be said in each frame [shape=(T, U)]; None: all
    """

    counts: Index
    densities: tuple[Index, ...]
    ties: tuple[Index, ...]
    spoken: Index
    allowed: NDArray[np.bool_] | None

    def masked(self, logs: Sequence[Single]) -> tuple[Single, ...]:
        """Return log densities [each shape=(T, G')] without what may not be said."""
        if self.allowed is None:
            return tuple(logs)
        return (np.where(self.allowed[:, self.spoken], logs[0], np.float32(-np.inf)), *logs[1:])

    @abstractmethod
    def posteriors(self, transitions: Any, logs: Sequence[Single]) -> Posteriors:
        """Return what a recording says about the chains.

        transitions : those that the lattice is of
        logs : log densities of all groups [each shape=(T, G')]
        """

    @abstractmethod
    def best_path(self, transitions: Any, logs: Sequence[Single]) -> tuple[Index, float]:
        """Return the most probable joint states [shape=(T,)] and their log probability (-inf: there is no path)."""


@dataclass(frozen=True, eq=False)
class Joint:
    """The posterior of joint states.

    states      : which they are [shape=(S',)]
    probability : of each [shape=(T, S')]
    """

    states: Index
    probability: Single


@dataclass(frozen=True, eq=False)
class Posteriors:
    """Probabilities of states given a recording.

    chains    : of the states of each chain [each shape=(T, N_c)]
    densities : of the densities of each group that the lattice needs [each shape=(T, G')]
    best      : the most probable joint state of every frame [shape=(T,)]
    counts    : what transitions are learned from [shape=(C',)]
    log_likelihood : of the recording; -inf where there is no path, and then all else is 0
    joint     : of joint states; None where there are too many to list
    """

    chains: tuple[Single, ...]
    densities: tuple[Single, ...]
    best: Index
    counts: NDArray[np.float64]
    log_likelihood: float
    joint: Joint | None = None


def summed(posterior: Single, tie: Index, count: int) -> Single:
    """Return the posterior of every density [shape=(T, G)] from that of joint states [shape=(T, S)].

    tie : the density of each joint state [shape=(S,)]
    """
    order = np.argsort(tie, kind="stable")
    present, starts = np.unique(tie[order], return_index=True)
    result = np.zeros((len(posterior), count), np.float32)
    result[:, present] = np.add.reduceat(posterior.take(order, axis=1), starts, axis=1)
    return result
