"""Inference in products whose joint states and arcs are listed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import Single
from lipmotion.engines.coupled.chains.lattice import Joint, Lattice, Posteriors, summed
from lipmotion.engines.coupled.chains.transitions import Transitions
from lipmotion.kernels.arcs import NetworkArrays
from lipmotion.kernels.network import ForwardBackwardNetwork
from lipmotion.kernels.viterbi import best_path

Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class NetworkLattice(Lattice):
    """Joint states with the arcs between them; ``counts`` are these arcs, sorted by target.

    states  : which they are [shape=(S',)]
    chain_states : the state of each chain in them [shape=(C, S')]
    network : laid out, without probabilities
    """

    states: Index
    chain_states: Index
    network: ForwardBackwardNetwork

    def posteriors(self, transitions: Transitions, logs: Sequence[Single]) -> Posteriors:  # noqa: D102
        ready = self.network.with_arcs(transitions.arc_log[self.counts], transitions.log_initial[self.states])
        order = ready.layout.order
        columns = [tie[order] for tie in self.ties]
        found = ready.product_posteriors(logs, columns, np.array([len(logs[0])]))
        structure = transitions.product.structure
        return Posteriors(
            tuple(
                summed(found.posterior, states[order], count)
                for states, count in zip(self.chain_states, structure.counts, strict=True)
            ),
            tuple(
                summed(found.posterior, tie, len(chosen)) for tie, chosen in zip(columns, self.densities, strict=True)
            ),
            self.states[order[found.posterior.argmax(axis=1)]],
            found.counts,
            float(found.log_likelihood[0]),
            Joint(self.states[order], found.posterior),
        )

    def best_path(self, transitions: Transitions, logs: Sequence[Single]) -> tuple[Index, float]:  # noqa: D102
        def log_emission(first: int, end: int) -> Single:
            total = logs[0][first:end].take(self.ties[0], axis=1)
            for log, tie in zip(logs[1:], self.ties[1:], strict=True):
                total += log[first:end].take(tie, axis=1)
            return total

        count = len(self.states)
        path, score = best_path(
            log_emission,
            len(logs[0]),
            NetworkArrays(
                np.arange(count),
                self.network.arc_from,
                transitions.arc_log[self.counts].astype(np.float32),
                self.network.arc_start,
                transitions.log_initial[self.states].astype(np.float32),
                np.zeros(count, np.float32),
            ),
            layout=lambda: self.network.layout,
        )
        return self.states[path], score


def network_lattice(
    transitions: Transitions, ties: Sequence[Index], allowed: NDArray[np.bool_] | None
) -> NetworkLattice:
    """Return where chains can be.

    ties    : the density of each joint state in every group [each shape=(S,)]
    allowed : the units of the first chain that may be said in each frame [shape=(T, U)]; None: all
    """
    product = transitions.product
    structure = product.structure
    inside = np.ones(len(product.joints), bool)
    if allowed is not None:
        said = allowed.any(axis=0)
        for chain, own in enumerate(product.chain_states):
            fitting = np.zeros(len(structure.units[chain]), bool)
            fitting[np.asarray(structure.follows[chain])[said]] = True
            inside &= fitting[own // structure.states]
    states = np.flatnonzero(inside)
    arcs = np.flatnonzero(inside[product.arc_from] & inside[product.arc_to])
    place = np.cumsum(inside) - 1
    arc_from, arc_to = place[product.arc_from[arcs]], place[product.arc_to[arcs]]
    network = ForwardBackwardNetwork.of(
        arc_from,
        np.zeros(len(arcs)),
        np.searchsorted(arc_to, np.arange(len(states))),
        np.zeros(len(states)),
        np.zeros(len(states)),
    )
    densities, positions = zip(*(np.unique(tie[states], return_inverse=True) for tie in ties), strict=True)
    spoken = np.zeros(len(densities[0]), np.intp)
    spoken[positions[0]] = product.chain_states[0][states] // structure.states
    return NetworkLattice(arcs, densities, positions, spoken, allowed, states, product.chain_states[:, states], network)
