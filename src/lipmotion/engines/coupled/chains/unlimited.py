"""Chains without a limit of asynchrony: a product too large to list, whose chains move independently."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import Single
from lipmotion.engines.coupled.chains.lattice import Lattice, Posteriors
from lipmotion.engines.coupled.chains.product import Grammar
from lipmotion.engines.coupled.chains.structures import Structure
from lipmotion.kernels.factorial import factorial_posteriors
from lipmotion.kernels.factorial_path import factorial_best_path
from lipmotion.kernels.loops import FactorialLogLikelihoods, Loop, LoopCounts

Array = NDArray[np.float64]
Index = NDArray[np.intp]
UNSEEN = np.float32(-10)
"""What the log density of a joint state that training never saw loses: its chains' own densities stand for it, and
without this loss nothing would hold the chains together (chosen on the validation list; docs/results/coupled.md)."""
LEAST = 1e-5


@dataclass(frozen=True, eq=False)
class FreeProduct:
    """Two chains, each of which may be in any of its states; joint state = first chain's state · N_1 + second's.

    grammar : each chain goes by its own
    """

    structure: Structure
    grammar: Grammar

    @cached_property
    def chain_states(self) -> Index:
        """The state of each chain in each joint state [shape=(2, S)]."""
        return np.indices(self.structure.counts).reshape(2, -1)

    def name(self, state: int) -> str:
        """Return what a joint state is, in words."""
        return self.structure.name(self.chain_states[:, state].tolist())


@dataclass(frozen=True, eq=False)
class FreeTransitions:
    """When two independent chains move on.

    advance : probability of moving on in each state [shapes=(N_0,), (N_1,)]
    pairs   : the joint states with densities of their own, by the states of both chains [shape=(P, 2)]
    Source: Xie & Liu 2007, Fig. 3 c and Eq. 18.
    """

    product: FreeProduct
    advance: tuple[Array, Array]
    pairs: Index

    @property
    def count(self) -> int:
        """How many numbers transitions are learned from: moves of every state, then stays, chain by chain."""
        return 2 * sum(self.product.structure.counts)

    def relearned(self, counts: Array) -> FreeTransitions:
        """Return the probabilities that explain best how often each state was left or not; unseen ones stay."""
        edges = np.cumsum([0, *np.repeat(self.product.structure.counts, 2)])
        parts = [counts[a:b] for a, b in pairwise(edges.tolist())]
        first, second = (
            np.where(moved + stayed > 0, moved / np.maximum(moved + stayed, 1e-300), old)
            for moved, stayed, old in zip(parts[::2], parts[1::2], self.advance, strict=True)
        )
        return replace(self, advance=(np.clip(first, LEAST, 1 - LEAST), np.clip(second, LEAST, 1 - LEAST)))

    def loop(self, chain: int, units: Index) -> Loop:
        """Return one chain, of some units, for the kernel."""
        structure, grammar = self.product.structure, self.product.grammar
        advance = self.advance[chain].reshape(-1, structure.states)[units].T
        initial = np.zeros(advance.shape)
        initial[0] = grammar.firsts[chain][units] / grammar.firsts[chain].sum()
        enter = grammar.bigrams[chain][np.ix_(units, units)]
        return Loop(1 - advance, advance[:-1], advance[-1], enter, initial, np.ones(advance.shape))


@dataclass(frozen=True, eq=False)
class FreeLattice(Lattice):
    """Some units of both chains; ``densities`` are their states', then those of the pairs inside.

    units  : of each chain
    states : of each chain, as the kernel numbers them
    pairs  : the places among these of both states of each pair [shape=(P', 2)]
    visible : the units of the second chain that may be seen in each frame [shape=(T, V)]; None: all
    """

    units: tuple[Index, Index]
    states: tuple[Index, Index]
    pairs: Index
    visible: NDArray[np.bool_] | None

    def masked(self, logs: Sequence[Single]) -> tuple[Single, ...]:  # noqa: D102
        heard, *seen = super().masked(logs)
        heard = heard.copy()
        heard[:, : len(self.states[0])] += UNSEEN
        if self.visible is not None:
            count = len(self.states[1])
            hidden = ~self.visible[:, np.tile(self.units[1], count // max(len(self.units[1]), 1))]
            seen = [log.copy() for log in seen]
            for log in seen:
                log[:, :count][hidden] = -np.inf
                log[:, count:][hidden[:, self.pairs[:, 1]]] = -np.inf
        return (heard, *seen)

    def posteriors(self, transitions: FreeTransitions, logs: Sequence[Single]) -> Posteriors:  # noqa: D102
        found = factorial_posteriors(*self._loops(transitions), self._evidence(logs))
        pair = found.pair.astype(np.float32)
        densities = []
        for chain, posterior in enumerate((found.audio, found.visual)):
            own = posterior.astype(np.float32)
            np.subtract.at(own.T, self.pairs[:, chain], pair.T)
            densities.append(np.concatenate([np.maximum(own, 0), pair], axis=1))
        structure = transitions.product.structure
        chains = []
        for posterior, states, count in zip((found.audio, found.visual), self.states, structure.counts, strict=True):
            full = np.zeros((len(posterior), count), np.float32)
            full[:, states] = posterior
            chains.append(full)
        return Posteriors(
            tuple(chains),
            (densities[0], *densities[1:] * (len(logs) - 1)),
            chains[0].argmax(axis=1) * structure.counts[1] + chains[1].argmax(axis=1),
            np.concatenate([_counted(counts) for counts in (found.audio_counts, found.visual_counts)]),
            found.log_likelihood,
        )

    def best_path(self, transitions: FreeTransitions, logs: Sequence[Single]) -> tuple[Index, float]:  # noqa: D102
        first, second, score = factorial_best_path(*self._loops(transitions), self._evidence(logs))
        count = transitions.product.structure.counts[1]
        return self.states[0][first] * count + self.states[1][second], score

    def _loops(self, transitions: FreeTransitions) -> tuple[Loop, Loop]:
        return transitions.loop(0, self.units[0]), transitions.loop(1, self.units[1])

    def _evidence(self, logs: Sequence[Single]) -> FactorialLogLikelihoods:
        heard, seen = logs[0], sum(logs[2:], logs[1])
        first, second = (len(states) for states in self.states)
        return FactorialLogLikelihoods(
            np.ascontiguousarray(heard[:, :first]),
            np.ascontiguousarray(seen[:, :second]),
            heard[:, first:] + seen[:, second:],
            self.pairs,
        )


def free_lattice(transitions: FreeTransitions, ties: Sequence[Index], allowed: NDArray[np.bool_] | None) -> FreeLattice:
    """Return where two free chains can be; arguments as in ``network.network_lattice``."""
    structure = transitions.product.structure
    every = tuple(np.arange(len(units)) for units in structure.units)
    visible, units = None, (every[0], every[1])
    if allowed is not None:
        looks = np.asarray(structure.follows[1])
        visible = np.zeros((len(allowed), len(every[1])), bool)
        np.logical_or.at(visible.T, looks, _wider(allowed).T)
        units = np.flatnonzero(allowed.any(axis=0)), np.flatnonzero(visible.any(axis=0))
    states = tuple(np.concatenate([own * structure.states + s for s in range(structure.states)]) for own in units)
    places = [np.full(count, -1) for count in structure.counts]
    for place, own in zip(places, states, strict=True):
        place[own] = np.arange(len(own))
    pairs = np.stack([places[chain][transitions.pairs[:, chain]] for chain in range(2)], axis=1)
    inside = np.flatnonzero((pairs >= 0).all(axis=1))
    counts, edge = [], 0
    for own, total in zip(states, structure.counts, strict=True):
        counts += [edge + own, edge + total + own]
        edge += 2 * total
    densities = [
        np.concatenate([states[min(number, 1)], structure.counts[min(number, 1)] + inside])
        for number in range(len(ties))
    ]
    spoken = np.concatenate([states[0], transitions.pairs[inside, 0]]) // structure.states
    positions = []
    for chosen, tie in zip(densities, ties, strict=True):
        place = np.zeros(int(tie.max()) + 1, np.intp)
        place[chosen] = np.arange(len(chosen))
        positions.append(place[tie[np.isin(tie, chosen)]])
    return FreeLattice(
        np.concatenate(counts),
        tuple(densities),
        tuple(positions),
        spoken,
        allowed,
        (units[0], units[1]),
        (states[0], states[1]),
        pairs[inside],
        visible,
    )


def _wider(allowed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return units that may be seen: what is said within 100 ms."""
    total = np.cumsum(np.pad(allowed.astype(np.intp), ((REACH + 1, REACH), (0, 0))), axis=0)
    return (total[2 * REACH + 1 :] - total[: -2 * REACH - 1]) > 0


REACH = 10


def _counted(counts: LoopCounts) -> Array:
    """Return how often each state was left and not, as the kernel numbers them [shape=(2 N',)]."""
    moved = np.concatenate([counts.onward, counts.enter.sum(axis=1)[None]])
    return np.concatenate([moved.ravel(), counts.stay.ravel()])
