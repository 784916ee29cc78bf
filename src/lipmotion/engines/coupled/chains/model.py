"""Coupled chains as one value: where they can be, when they move on, what they emit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import Group, Observed, Ready, Single
from lipmotion.engines.coupled.chains.lattice import Index, Lattice, Posteriors
from lipmotion.engines.coupled.chains.network import network_lattice
from lipmotion.engines.coupled.chains.structures import Structure
from lipmotion.engines.coupled.chains.transitions import Transitions
from lipmotion.engines.coupled.chains.unlimited import FreeTransitions, free_lattice


@dataclass(frozen=True, eq=False)
class Chains:
    """Chains of states with their densities.

    streams     : their names; the first is speech
    transitions : with the product of the chains
    groups      : of streams, speech in the first
    """

    streams: tuple[str, ...]
    transitions: Transitions | FreeTransitions
    groups: tuple[Group, ...]

    @property
    def structure(self) -> Structure:
        """Of the chains."""
        return self.transitions.product.structure

    @cached_property
    def everywhere(self) -> Lattice:
        """All joint states: where a recording of unknown words can be."""
        return self._lattice(None)

    def lattice(self, allowed: NDArray[np.bool_]) -> Lattice:
        """Return where a recording can be.

        allowed : the units of the first chain that may be said in each frame [shape=(T, U)]
        """
        return self._lattice(allowed)

    def _lattice(self, allowed: NDArray[np.bool_] | None) -> Lattice:
        ties = [group.tie for group in self.groups]
        if isinstance(self.transitions, FreeTransitions):
            return free_lattice(self.transitions, ties, allowed)
        return network_lattice(self.transitions, ties, allowed)

    @cached_property
    def ready(self) -> tuple[Ready, ...]:
        """The densities, group by group, as matrices."""
        return tuple(group.ready() for group in self.groups)

    def evidence(self, observed: Observed, lattice: Lattice) -> Evidence:
        """Return the log densities of frames, those that the lattice needs."""
        found = [ready.divided(observed, chosen) for ready, chosen in zip(self.ready, lattice.densities, strict=True)]
        return Evidence(lattice.masked([log for log, _ in found]), tuple(shares for _, shares in found))

    def posteriors(self, evidence: Evidence, lattice: Lattice) -> Posteriors:
        """Return what a recording says about the chains."""
        return lattice.posteriors(self.transitions, evidence.log)

    def inferred(self, observed: Observed, lattice: Lattice) -> Inferred:
        """Return what a recording says about the chains, with what that rests on."""
        evidence = self.evidence(observed, lattice)
        return Inferred(observed, lattice, evidence, self.posteriors(evidence, lattice))

    def best_path(self, evidence: Evidence, lattice: Lattice) -> tuple[Index, float]:
        """Return the most probable joint states [shape=(T,)] and their log probability (-inf: there is no path)."""
        return lattice.best_path(self.transitions, evidence.log)


@dataclass(frozen=True, eq=False)
class Evidence:
    """Log densities of all groups [each shape=(T, G')], and the shares of their components [each shape=(T, M, G')].

    G' are those that the lattice needs.
    """

    log: tuple[Single, ...]
    shares: tuple[Single | None, ...]


@dataclass(frozen=True, eq=False)
class Inferred:
    """What a recording says about chains, with what that rests on."""

    observed: Observed
    lattice: Lattice
    evidence: Evidence
    posteriors: Posteriors
