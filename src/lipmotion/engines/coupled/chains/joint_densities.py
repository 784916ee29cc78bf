"""Densities of joint states: what a factorial HMM emits (Xie & Liu 2007, Fig. 3 c).

Two chains of phones have 235 × 235 joint states, far more than there are data for. Those that training was seen in have
densities of their own, which begin as their chains'; all others share those of their chains' states.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.model import Chains
from lipmotion.engines.coupled.chains.structures import Structure
from lipmotion.engines.coupled.chains.transitions import Transitions
from lipmotion.engines.coupled.chains.unlimited import FreeProduct, FreeTransitions

LEAST_FRAMES = 10
"""Of a joint state in training, for densities of its own."""


def with_pairs(chains: Chains, transitions: Transitions, visits: NDArray[Any], structure: Structure) -> Chains:
    """Return two chains whose frequent joint states have densities of their own.

    transitions : of the chains, with a limit of asynchrony
    visits      : frames spent in each joint state [shape=(S,)]
    structure   : what they become: the same, or the same without a limit
    """
    product = transitions.product
    pairs = np.unique(product.chain_states[:, visits >= LEAST_FRAMES].T, axis=0)
    becomes: Transitions | FreeTransitions = transitions
    states = product.chain_states
    if structure.limit is None:
        free = FreeProduct(structure, product.grammar)
        first, second = (
            _own(states[chain], advance[rows], count)
            for chain, (advance, rows, count) in enumerate(
                zip(transitions.advance, transitions.rows, structure.counts, strict=True)
            )
        )
        becomes = FreeTransitions(free, (first, second), pairs)
        states = free.chain_states
    number = np.full(structure.counts, -1)
    number[tuple(pairs.T)] = np.arange(len(pairs))
    pair = number[states[0], states[1]]
    groups = []
    for group in chains.groups:
        chain = structure.chain_of(group.streams[0])
        mixtures = group.mixtures.joined(group.mixtures.picked(pairs[:, chain]))
        tie = np.where(pair >= 0, structure.counts[chain] + pair, states[chain])
        groups.append(replace(group, mixtures=mixtures, tie=tie))
    return Chains(chains.streams, becomes, tuple(groups))


def _own(states: NDArray[np.intp], values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the mean of values [shape=(S,)] over the joint states with each state of a chain [shape=(N,)]."""
    return np.bincount(states, values, count) / np.maximum(np.bincount(states, minlength=count), 1)
