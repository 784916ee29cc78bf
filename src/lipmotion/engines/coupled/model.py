"""Coupled chains as one value: where they can be, when they move on, what they emit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.densities import Group, Observed, Ready, Single, density_posteriors
from lipmotion.engines.coupled.lattice import Lattice, whole
from lipmotion.engines.coupled.systems import Structure
from lipmotion.engines.coupled.transitions import Transitions
from lipmotion.kernels.network import Expectation
from lipmotion.kernels.viterbi import best_path

Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Chains:
    """Chains of states with their densities.

    streams     : their names; the first is speech
    transitions : with the product of the chains
    groups      : of streams, speech in the first
    """

    streams: tuple[str, ...]
    transitions: Transitions
    groups: tuple[Group, ...]

    @property
    def structure(self) -> Structure:
        """Of the chains."""
        return self.transitions.product.structure

    @cached_property
    def everywhere(self) -> Lattice:
        """All joint states: where a recording of unknown words can be."""
        return whole(self.transitions.product, [group.tie for group in self.groups])

    @cached_property
    def ready(self) -> tuple[Ready, ...]:
        """The densities, group by group, as matrices."""
        return tuple(group.ready() for group in self.groups)

    @cached_property
    def _arc_log(self) -> NDArray[np.float64]:
        return self.transitions.arc_log

    @cached_property
    def _log_initial(self) -> NDArray[np.float64]:
        with np.errstate(divide="ignore"):
            return np.log(self.transitions.product.initial)

    def evidence(self, observed: Observed, lattice: Lattice) -> Evidence:
        """Return the log densities of frames, those that the lattice needs."""
        found = [ready.divided(observed, chosen) for ready, chosen in zip(self.ready, lattice.densities, strict=True)]
        logs = [log for log, _ in found]
        if lattice.allowed is not None:
            logs[0] = np.where(lattice.allowed[:, lattice.spoken], logs[0], np.float32(-np.inf))
        return Evidence(tuple(logs), tuple(shares for _, shares in found))

    def expectation(self, lattice: Lattice) -> Expectation:
        """Return the lattice ready for forward–backward."""
        return lattice.network.with_arcs(self._arc_log[lattice.arcs], self._log_initial[lattice.states])

    def posteriors(self, evidence: Evidence, lattice: Lattice) -> Posteriors:
        """Return what a recording says about the chains."""
        expectation = self.expectation(lattice)
        order = expectation.layout.order
        columns = [tie[order] for tie in lattice.ties]
        expected = expectation.over_chains(evidence.log, columns, np.array([len(evidence.log[0])]))
        return Posteriors(
            joint=expected.posterior,
            states=lattice.states[order],
            densities=tuple(
                density_posteriors(expected.posterior, tie, len(chosen))
                for tie, chosen in zip(columns, lattice.densities, strict=True)
            ),
            arcs=expected.counts,
            log_likelihood=float(expected.log_likelihood[0]),
        )

    def best_path(self, evidence: Evidence, lattice: Lattice) -> tuple[Index, float]:
        """Return the most probable joint states [shape=(T,)] and their log probability (-inf: there is no path)."""
        network, logs = lattice.network, evidence.log

        def log_emission(first: int, end: int) -> Single:
            total = logs[0][first:end].take(lattice.ties[0], axis=1)
            for log, tie in zip(logs[1:], lattice.ties[1:], strict=True):
                total += log[first:end].take(tie, axis=1)
            return total

        count = len(lattice.states)
        path, score = best_path(
            log_emission,
            len(logs[0]),
            np.arange(count),
            network.arc_from,
            self._arc_log[lattice.arcs].astype(np.float32),
            network.arc_start,
            self._log_initial[lattice.states].astype(np.float32),
            np.zeros(count, np.float32),
            layout=lambda: network.layout,
        )
        return lattice.states[path], score


@dataclass(frozen=True, eq=False)
class Evidence:
    """Log densities of all groups [each shape=(T, G')], and the shares of their components [each shape=(T, M, G')].

    G' are those that the lattice needs.
    """

    log: tuple[Single, ...]
    shares: tuple[Single | None, ...]


@dataclass(frozen=True, eq=False)
class Posteriors:
    """Probabilities of states given a recording.

    joint     : of joint states [shape=(T, S')]
    states    : which they are [shape=(S',)]
    densities : of the densities of each group that the lattice needs [each shape=(T, G')]
    arcs      : how often each arc of the lattice is expected to be followed [shape=(E',)]
    log_likelihood : of the recording; -inf where there is no path, and then all else is 0
    """

    joint: Single
    states: Index
    densities: tuple[Single, ...]
    arcs: NDArray[np.float64]
    log_likelihood: float

    @property
    def best(self) -> Index:
        """The most probable joint state of every frame [shape=(T,)]."""
        return self.states[self.joint.argmax(axis=1)]
