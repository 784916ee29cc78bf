"""Emission densities of joint states: the factorial HMM (Xie & Liu 2007, Fig. 3 c).

Two chains of phones have 235 × 235 joint states, far more than there is data for. The joint states that occur often in
training get densities of their own, initialised with those of their chains' states; all others share the densities of
their chains' states.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.factorial_lattice import FactorialProduct, FactorialTransitions
from lipmotion.engines.coupled.chains.model import Chains
from lipmotion.engines.coupled.chains.structures import Structure
from lipmotion.engines.coupled.chains.transitions import Transitions

LEAST_FRAMES = 10
"""A joint state with at least so many frames in training has densities of its own."""


def with_joint_state_densities(
    chains: Chains, transitions: Transitions, visits: NDArray[Any], structure: Structure
) -> Chains:
    """Return two chains whose frequent joint states have emission densities of their own.

    transitions : of the chains, with a limit of asynchrony
    visits      : frames spent in each joint state [shape=(S,)]
    structure   : of the returned chains: that of ``chains``, or the same without a limit of asynchrony
    """
    product = transitions.product
    frequent = np.unique(product.chain_states[:, visits >= LEAST_FRAMES].T, axis=0)
    new_transitions: Transitions | FactorialTransitions = transitions
    chain_states = product.chain_states
    if structure.limit is None:
        new_transitions = _unlimited(transitions, structure, frequent)
        chain_states = new_transitions.product.chain_states
    number = np.full(structure.state_counts, -1)
    number[tuple(frequent.T)] = np.arange(len(frequent))
    frequent_number = number[chain_states[0], chain_states[1]]
    groups = []
    for group in chains.groups:
        chain = structure.chain_of(group.streams[0])
        mixtures = group.mixtures.concatenated(group.mixtures.selected(frequent[:, chain]))
        tie = np.where(frequent_number >= 0, structure.state_counts[chain] + frequent_number, chain_states[chain])
        groups.append(replace(group, mixtures=mixtures, tie=tie))
    return Chains(chains.streams, new_transitions, tuple(groups))


def _unlimited(transitions: Transitions, structure: Structure, frequent: NDArray[np.intp]) -> FactorialTransitions:
    """Return transitions of independent chains: the probability of moving on is the mean over joint states.

    frequent : joint states with densities of their own, as the states of both chains [shape=(P, 2)]
    """
    product = transitions.product
    first, second = (
        _mean_by_state(product.chain_states[chain], advance[rows], count)
        for chain, (advance, rows, count) in enumerate(
            zip(transitions.advance, transitions.rows, structure.state_counts, strict=True)
        )
    )
    return FactorialTransitions(FactorialProduct(structure, product.grammar), (first, second), frequent)


def _mean_by_state(states: NDArray[np.intp], values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the mean of the values of the joint states that have each state of a chain [shape=(N,)].

    states : the chain's state in each joint state [shape=(S,)]
    values : of the joint states [shape=(S,)]
    count  : the number of the chain's states, N
    """
    return np.bincount(states, values, count) / np.maximum(np.bincount(states, minlength=count), 1)
