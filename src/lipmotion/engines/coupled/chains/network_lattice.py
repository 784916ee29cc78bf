"""Lattices of products whose joint states and arcs are listed one by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import Single
from lipmotion.engines.coupled.chains.lattice import JointPosteriors, Lattice, LatticePosteriors, tied_posteriors
from lipmotion.engines.coupled.chains.transitions import Transitions
from lipmotion.kernels.sequences.arcs import NetworkArrays
from lipmotion.kernels.sequences.network import ForwardBackwardNetwork
from lipmotion.kernels.sequences.viterbi import best_path

Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class NetworkLattice(Lattice):
    """Some joint states with the arcs between them; ``transition_index`` numbers these arcs, sorted by target.

    states       : the numbers of the joint states in the product [shape=(S',)]
    chain_states : the state of each chain in these joint states [shape=(C, S')]
    network      : the arcs, laid out for forward–backward, without probabilities
    """

    states: Index
    chain_states: Index
    network: ForwardBackwardNetwork

    def posteriors(self, transitions: Transitions, logs: Sequence[Single]) -> LatticePosteriors:  # noqa: D102
        network = self.network.with_arcs(
            transitions.arc_log[self.transition_index], transitions.log_initial[self.states]
        )
        order = network.layout.order
        ordered_ties = [tie[order] for tie in self.ties]
        expected = network.product_posteriors(logs, ordered_ties, np.array([len(logs[0])]))
        structure = transitions.product.structure
        return LatticePosteriors(
            tuple(
                tied_posteriors(expected.posterior, states[order], count)
                for states, count in zip(self.chain_states, structure.state_counts, strict=True)
            ),
            tuple(
                tied_posteriors(expected.posterior, tie, len(densities))
                for tie, densities in zip(ordered_ties, self.densities, strict=True)
            ),
            self.states[order[expected.posterior.argmax(axis=1)]],
            expected.counts,
            float(expected.log_likelihood[0]),
            JointPosteriors(self.states[order], expected.posterior),
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
                transitions.arc_log[self.transition_index].astype(np.float32),
                self.network.arc_start,
                transitions.log_initial[self.states].astype(np.float32),
                np.zeros(count, np.float32),
            ),
            layout=lambda: self.network.layout,
        )
        return self.states[path], score


def network_lattice(
    transitions: Transitions, ties: Sequence[Index], allowed_units: NDArray[np.bool_] | None
) -> NetworkLattice:
    """Return the lattice of the joint states whose units are allowed in some frame.

    ties          : for each stream group, the density of each joint state [each shape=(S,)]
    allowed_units : the units of the first chain that each frame may belong to [shape=(T, U)]; None: all
    """
    product = transitions.product
    structure = product.structure
    inside = np.ones(len(product.joint_states), bool)
    if allowed_units is not None:
        present = allowed_units.any(axis=0)
        for chain, chain_states in enumerate(product.chain_states):
            corresponding = np.zeros(len(structure.units[chain]), bool)
            corresponding[np.asarray(structure.corresponding_units[chain])[present]] = True
            inside &= corresponding[chain_states // structure.states]
    states = np.flatnonzero(inside)
    arcs = np.flatnonzero(inside[product.arc_from] & inside[product.arc_to])
    position = np.cumsum(inside) - 1
    arc_from, arc_to = position[product.arc_from[arcs]], position[product.arc_to[arcs]]
    network = ForwardBackwardNetwork.of(
        arc_from,
        np.zeros(len(arcs)),
        np.searchsorted(arc_to, np.arange(len(states))),
        np.zeros(len(states)),
        np.zeros(len(states)),
    )
    densities, lattice_ties = zip(*(np.unique(tie[states], return_inverse=True) for tie in ties), strict=True)
    density_units = np.zeros(len(densities[0]), np.intp)
    density_units[lattice_ties[0]] = product.chain_states[0][states] // structure.states
    return NetworkLattice(
        transition_index=arcs,
        densities=densities,
        ties=lattice_ties,
        density_units=density_units,
        allowed_units=allowed_units,
        states=states,
        chain_states=product.chain_states[:, states],
        network=network,
    )
