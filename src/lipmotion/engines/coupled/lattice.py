"""The part of a product in which a recording can be: all of it, or that of the units said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.product import Product
from lipmotion.kernels.network import Expectation

Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Lattice:
    """Some joint states of a product and the arcs between them; probabilities are those of the whole.

    states    : which they are [shape=(S',)]
    arcs      : which they are [shape=(E',)], sorted by target
    network   : the same, laid out, without probabilities
    densities : those needed of each group [each shape=(G',)]
    ties      : the position there of each state's [each shape=(S',)]
    spoken    : the unit of the first chain behind each density of the first group [shape=(G',)]
    allowed   : the units that may be said in each frame [shape=(T, U)]; None: all
    """

    states: Index
    arcs: Index
    network: Expectation
    densities: tuple[Index, ...]
    ties: tuple[Index, ...]
    spoken: Index
    allowed: NDArray[np.bool_] | None


def whole(product: Product, ties: Sequence[Index]) -> Lattice:
    """Return all of a product.

    ties : the density of each joint state in every group [each shape=(S,)]
    """
    return _of(product, ties, np.ones(len(product.joints), bool), None)


def within(product: Product, ties: Sequence[Index], allowed: NDArray[np.bool_]) -> Lattice:
    """Return the part of a product that only some units can reach.

    allowed : the units of the first chain that may be said in each frame [shape=(T, U)]
    """
    structure = product.structure
    said = allowed.any(axis=0)
    inside = np.ones(len(product.joints), bool)
    for chain, states in enumerate(product.chain_states):
        fitting = np.zeros(len(structure.units[chain]), bool)
        fitting[np.asarray(structure.follows[chain])[said]] = True
        inside &= fitting[states // structure.states]
    return _of(product, ties, inside, allowed)


def _of(
    product: Product, ties: Sequence[Index], inside: NDArray[np.bool_], allowed: NDArray[np.bool_] | None
) -> Lattice:
    states = np.flatnonzero(inside)
    arcs = np.flatnonzero(inside[product.arc_from] & inside[product.arc_to])
    place = np.cumsum(inside) - 1
    arc_from, arc_to = place[product.arc_from[arcs]], place[product.arc_to[arcs]]
    network = Expectation.of(
        arc_from,
        np.zeros(len(arcs)),
        np.searchsorted(arc_to, np.arange(len(states))),
        np.zeros(len(states)),
        np.zeros(len(states)),
    )
    densities, positions = zip(*(np.unique(tie[states], return_inverse=True) for tie in ties), strict=True)
    spoken = np.zeros(len(densities[0]), np.intp)
    spoken[positions[0]] = product.chain_states[0][states] // product.structure.states
    return Lattice(states, arcs, network, densities, positions, spoken, allowed)
