"""A lattice: the joint states in which an utterance can be, and inference over the paths through them."""

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
    """Some joint states of a product; their probabilities are those of the whole product.

    transition_index : where the C' transition statistics of the lattice stand among those of all chains [shape=(C',)]
    densities        : for each stream group, the densities that the lattice needs [each shape=(G',)]
    ties             : for each stream group, the density of each joint state, as a position in ``densities``
                       [each shape=(S',)]
    density_units    : the unit of the first chain to which each density of the first group belongs [shape=(G',)]
    allowed_units    : the units of the first chain that each frame may belong to [shape=(T, U)]; None: all
    """

    transition_index: Index
    densities: tuple[Index, ...]
    ties: tuple[Index, ...]
    density_units: Index
    allowed_units: NDArray[np.bool_] | None

    def masked(self, logs: Sequence[Single]) -> tuple[Single, ...]:
        """Return log densities of stream groups [each shape=(T, G')], -inf for units not allowed in a frame."""
        if self.allowed_units is None:
            return tuple(logs)
        return (np.where(self.allowed_units[:, self.density_units], logs[0], np.float32(-np.inf)), *logs[1:])

    @abstractmethod
    def posteriors(self, transitions: Any, logs: Sequence[Single]) -> LatticePosteriors:
        """Return the posteriors of states, by forward–backward, from log densities of stream groups [each shape=(T,
        G')].
        """

    @abstractmethod
    def best_path(self, transitions: Any, logs: Sequence[Single]) -> tuple[Index, float]:
        """Return the most probable path of joint states [shape=(T,)] and its log probability (-inf: there is none)."""


@dataclass(frozen=True, eq=False)
class JointPosteriors:
    """Joint states [shape=(S',)] and their posteriors in every frame [shape=(T, S')]."""

    states: Index
    probability: Single


@dataclass(frozen=True, eq=False)
class LatticePosteriors:
    """Posteriors of the hidden states of an utterance, and the expected counts of transitions.

    chains            : posteriors of the states of each chain [each shape=(T, N_c)]
    densities         : for each stream group, posteriors of the densities that the lattice needs [each shape=(T, G')]
    most_probable     : the most probable joint state of every frame [shape=(T,)]
    transition_counts : sufficient statistics of the transitions [shape=(C',)]
    log_likelihood    : of the utterance; -inf where there is no path, and then all other numbers are 0
    joint             : posteriors of joint states; None where these are too many to list
    """

    chains: tuple[Single, ...]
    densities: tuple[Single, ...]
    most_probable: Index
    transition_counts: NDArray[np.float64]
    log_likelihood: float
    joint: JointPosteriors | None = None


def tied_posteriors(posterior: Single, tie: Index, count: int) -> Single:
    """Return the posteriors of densities, or of states of a chain, that joint states share [shape=(T, G)].

    posterior : of joint states [shape=(T, S)]
    tie       : the density of each joint state [shape=(S,)]
    count     : the number of densities, G
    """
    order = np.argsort(tie, kind="stable")
    present, starts = np.unique(tie[order], return_index=True)
    result = np.zeros((len(posterior), count), np.float32)
    result[:, present] = np.add.reduceat(posterior.take(order, axis=1), starts, axis=1)
    return result
