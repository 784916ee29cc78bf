"""A lattice, the joint states in which an utterance can be, and inference over its paths; of factorial HMMs, too."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import Single
from lipmotion.engines.coupled.chains.product import MIN_ADVANCE, Grammar, Structure
from lipmotion.kernels.factorial import infer_factorial
from lipmotion.kernels.factorial_loops import FactorialLogLikelihoods, Loop, find_factorial_path

Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Lattice(ABC):
    """Some joint states of a product; their probabilities are those of the whole product.

    transition_index : where the C' transition statistics of the lattice stand among those of all chains [shape=(C',)]
    densities        : for each stream group, the densities that the lattice needs [each shape=(G',)]
    ties             : for each stream group, the place in ``densities`` of each joint state [each shape=(S',)]
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
        """Return the posteriors of states, by forward–backward, from log densities of stream groups [shape=(T, G')]."""

    @abstractmethod
    def best_path(self, transitions: Any, logs: Sequence[Single]) -> tuple[Index, float]:
        """Return the most probable path of joint states [shape=(T,)] and its log probability (-inf: there is none)."""


@dataclass(frozen=True, eq=False)
class LatticePosteriors:
    """Posteriors of the hidden states of an utterance, and the expected counts of transitions.

    chains            : posteriors of the states of each chain [each shape=(T, N_c)]
    densities         : for each stream group, posteriors of the densities that the lattice needs [each shape=(T, G')]
    most_probable     : the most probable joint state of every frame [shape=(T,)]
    transition_counts : sufficient statistics of the transitions [shape=(C',)]
    log_likelihood    : of the utterance; -inf where there is no path, and then all other numbers are 0
    joint             : joint states [shape=(S',)] and their posteriors [shape=(T, S')]; None: they are too many to list
    """

    chains: tuple[Single, ...]
    densities: tuple[Single, ...]
    most_probable: Index
    transition_counts: NDArray[np.float64]
    log_likelihood: float
    joint: tuple[Index, Single] | None = None


def tie_posteriors(posterior: Single, tie: Index, count: int) -> Single:
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


Array = NDArray[np.float64]
VISIBLE_FRAMES = 10  # the lips may be in a unit this many frames before and after the voice


@dataclass(frozen=True, eq=False)
class FactorialProduct:
    """Two chains, each of which may be in any of its states; joint state = first chain's state · N_1 + second's."""

    structure: Structure
    grammar: Grammar

    @cached_property
    def chain_states(self) -> Index:
        """The state of each chain in each joint state [shape=(2, S)]."""
        return np.indices(self.structure.state_counts).reshape(2, -1)


@dataclass(frozen=True, eq=False)
class FactorialTransitions:
    """Transitions of two independent chains.

    advance            : probability of moving on in each state [shapes=(N_0,), (N_1,)]
    own_density_states : the states of both chains in the P joint states with densities of their own [shape=(P, 2)]
    Source: Xie & Liu 2007, Fig. 3 c and Eq. 18.
    """

    product: FactorialProduct
    advance: tuple[Array, Array]
    own_density_states: Index

    @property
    def statistic_count(self) -> int:
        """The number of transition statistics: chain by chain, how often each state is left, then how often kept."""
        return 2 * sum(self.product.structure.state_counts)

    def reestimated(self, counts: Array) -> FactorialTransitions:
        """Return the transitions of an M-step, from counts of leaving and keeping; unseen states stay."""
        edges = np.cumsum([0, *np.repeat(self.product.structure.state_counts, 2)])
        parts = [counts[a:b] for a, b in pairwise(edges.tolist())]
        first, second = (
            np.where(moved + stayed > 0, moved / np.maximum(moved + stayed, 1e-300), old)
            for moved, stayed, old in zip(parts[::2], parts[1::2], self.advance, strict=True)
        )
        low, high = MIN_ADVANCE, 1 - MIN_ADVANCE
        return replace(self, advance=(np.clip(first, low, high), np.clip(second, low, high)))

    def loop(self, chain: int, units: Index) -> Loop:
        """Return one chain, restricted to some of its units, as the kernel takes it."""
        structure, grammar = self.product.structure, self.product.grammar
        advance = self.advance[chain].reshape(-1, structure.states)[units].T
        initial = np.zeros(advance.shape)
        initial[0] = grammar.initial[chain][units] / grammar.initial[chain].sum()
        enter = grammar.bigrams[chain][np.ix_(units, units)]
        return Loop(1 - advance, advance[:-1], advance[-1], enter, initial, np.ones(advance.shape))


@dataclass(frozen=True, eq=False)
class FactorialLattice(Lattice):
    """Some units of both chains.

    ``densities`` are those of the states of the group's chain, then the P' joint states' inside that have their own.

    units                 : of each chain
    states                : of each chain, in the order of the kernel
    own_density_positions : places in ``states`` of both chains of the joint states with their own [shape=(P', 2)]
    visible_units         : the units of the second chain that each frame may belong to [shape=(T, V)]; None: all
    unseen_loss           : what joint states without densities of their own lose, nats
    """

    units: tuple[Index, Index]
    states: tuple[Index, Index]
    own_density_positions: Index
    visible_units: NDArray[np.bool_] | None
    unseen_loss: float

    def masked(self, logs: Sequence[Single]) -> tuple[Single, ...]:  # noqa: D102
        speech, *visual = super().masked(logs)
        speech = speech.copy()
        speech[:, : len(self.states[0])] -= np.float32(self.unseen_loss)
        if self.visible_units is not None:
            count = len(self.states[1])
            forbidden = ~self.visible_units[:, np.tile(self.units[1], count // max(len(self.units[1]), 1))]
            visual = [log.copy() for log in visual]
            for log in visual:
                log[:, :count][forbidden] = -np.inf
                log[:, count:][forbidden[:, self.own_density_positions[:, 1]]] = -np.inf
        return (speech, *visual)

    def posteriors(self, transitions: FactorialTransitions, logs: Sequence[Single]) -> LatticePosteriors:  # noqa: D102
        expected = infer_factorial(*self._loops(transitions), self._log_likelihoods(logs))
        own = expected.pair.astype(np.float32)
        state_counts, chains, densities = transitions.product.structure.state_counts, [], []
        for chain, posterior in enumerate((expected.audio, expected.visual)):
            full = np.zeros((len(posterior), state_counts[chain]), np.float32)
            full[:, self.states[chain]] = posterior
            chains.append(full)
            states = np.eye(posterior.shape[1], dtype=np.float32)[self.own_density_positions[:, chain]]
            remaining = posterior - own @ states  # what joint states with densities of their own leave a state
            densities.append(np.concatenate([np.maximum(remaining, 0), own], axis=1, dtype=np.float32))
        advance_counts: list[Array] = []  # chain by chain: how often each state is left, then how often it is kept
        for counts in (expected.audio_counts, expected.visual_counts):
            advance_counts += [counts.onward.ravel(), counts.enter.sum(axis=1), counts.stay.ravel()]
        return LatticePosteriors(
            chains=tuple(chains),
            densities=(densities[0], *densities[1:] * (len(logs) - 1)),
            most_probable=chains[0].argmax(axis=1) * state_counts[1] + chains[1].argmax(axis=1),
            transition_counts=np.concatenate(advance_counts),
            log_likelihood=expected.log_likelihood,
        )

    def best_path(self, transitions: FactorialTransitions, logs: Sequence[Single]) -> tuple[Index, float]:  # noqa: D102
        first, second, score = find_factorial_path(*self._loops(transitions), self._log_likelihoods(logs))
        count = transitions.product.structure.state_counts[1]
        return self.states[0][first] * count + self.states[1][second], score

    def _loops(self, transitions: FactorialTransitions) -> tuple[Loop, Loop]:
        return transitions.loop(0, self.units[0]), transitions.loop(1, self.units[1])

    def _log_likelihoods(self, logs: Sequence[Single]) -> FactorialLogLikelihoods:
        """Return the log densities of both chains, visual streams added up, as the kernel takes them."""
        speech, visual = logs[0], sum(logs[2:], logs[1])
        first, second = (len(states) for states in self.states)
        return FactorialLogLikelihoods(
            np.ascontiguousarray(speech[:, :first]),
            np.ascontiguousarray(visual[:, :second]),
            speech[:, first:] + visual[:, second:],
            self.own_density_positions,
        )


def build_factorial_lattice(
    transitions: FactorialTransitions, ties: Sequence[Index], allowed_units: NDArray[np.bool_] | None
) -> FactorialLattice:
    """Return the lattice of the units that are allowed in some frame.

    ties          : for each stream group, the density of each joint state [each shape=(S,)]
    allowed_units : the units of the first chain that each frame may belong to [shape=(T, U)]; None: all
    """
    structure = transitions.product.structure
    visible_units = None if allowed_units is None else _find_visible_units(structure, allowed_units)
    first, second = (
        np.arange(len(units)) if allowed is None else np.flatnonzero(allowed.any(axis=0))
        for units, allowed in zip(structure.units, (allowed_units, visible_units), strict=True)
    )
    offsets = np.arange(structure.states)[:, None]  # the kernel's order: the first state of every unit, then the second
    states = (first * structure.states + offsets).ravel(), (second * structure.states + offsets).ravel()
    columns, index, start = [], [], 0
    for chain, (own, count) in enumerate(zip(states, structure.state_counts, strict=True)):
        position = np.full(count, -1)
        position[own] = np.arange(len(own))
        columns.append(position[transitions.own_density_states[:, chain]])
        index += [start + own, start + count + own]
        start += 2 * count
    own_density_positions = np.stack(columns, axis=1)
    inside = np.flatnonzero((own_density_positions >= 0).all(axis=1))
    chains = [min(number, 1) for number in range(len(ties))]
    densities = tuple(np.concatenate([states[chain], structure.state_counts[chain] + inside]) for chain in chains)
    inner_ties = []  # of the joint states whose density is in the lattice, as positions there
    for chosen, tie in zip(densities, ties, strict=True):
        position = np.zeros(int(tie.max()) + 1, np.intp)
        position[chosen] = np.arange(len(chosen))
        inner_ties.append(position[tie[np.isin(tie, chosen)]])
    return FactorialLattice(
        transition_index=np.concatenate(index),
        densities=densities,
        ties=tuple(inner_ties),
        density_units=np.concatenate([states[0], transitions.own_density_states[inside, 0]]) // structure.states,
        allowed_units=allowed_units,
        units=(first, second),
        states=states,
        own_density_positions=own_density_positions[inside],
        visible_units=visible_units,
        unseen_loss=structure.unseen_loss,
    )


def _find_visible_units(structure: Structure, allowed_units: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the units of the second chain that correspond to those allowed within 100 ms [shape=(T, V)]."""
    padded = np.pad(allowed_units.astype(np.intp), ((VISIBLE_FRAMES + 1, VISIBLE_FRAMES), (0, 0)))
    total = np.cumsum(padded, axis=0)
    near = (total[2 * VISIBLE_FRAMES + 1 :] - total[: -2 * VISIBLE_FRAMES - 1]) > 0
    visible = np.zeros((len(allowed_units), len(structure.units[1])), bool)
    np.logical_or.at(visible.T, np.asarray(structure.corresponding_units[1]), near.T)
    return visible
