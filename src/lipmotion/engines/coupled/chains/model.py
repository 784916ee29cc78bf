"""Coupled chains: their product with its transitions, their emission densities, and inference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import AudioVisualObservations, Single, StreamGroup
from lipmotion.engines.coupled.chains.lattice import (
    FactorialTransitions,
    Index,
    Lattice,
    LatticePosteriors,
    build_factorial_lattice,
    tie_posteriors,
)
from lipmotion.engines.coupled.chains.product import Structure, Transitions
from lipmotion.kernels.network import ForwardBackwardNetwork
from lipmotion.kernels.paths import NetworkArrays, best_path
from lipmotion.motion.space import MotionSpace
from lipmotion.stats.curves import with_dynamics
from lipmotion.types import EYE_DISTANCE, GREY, Speech


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
        order = self.network.layout.order
        ordered_ties = [tie[order] for tie in self.ties]
        arcs = transitions.arc_log[self.transition_index], transitions.log_initial[self.states]
        expected = self.network.posteriors(*arcs, logs, ordered_ties)
        structure = transitions.product.structure
        return LatticePosteriors(
            tuple(
                tie_posteriors(expected.posterior, states[order], count)
                for states, count in zip(self.chain_states, structure.state_counts, strict=True)
            ),
            tuple(
                tie_posteriors(expected.posterior, tie, len(densities))
                for tie, densities in zip(ordered_ties, self.densities, strict=True)
            ),
            self.states[order[expected.posterior.argmax(axis=1)]],
            expected.counts,
            expected.log_likelihood,
            (self.states[order], expected.posterior),
        )

    def best_path(self, transitions: Transitions, logs: Sequence[Single]) -> tuple[Index, float]:  # noqa: D102
        def log_emission(first: int, end: int) -> Single:
            total = logs[0][first:end].take(self.ties[0], axis=1)
            for log, tie in zip(logs[1:], self.ties[1:], strict=True):
                total += log[first:end].take(tie, axis=1)
            return total

        everywhere, log_final = np.arange(len(self.states)), np.zeros(len(self.states), np.float32)
        arc_log = transitions.arc_log[self.transition_index].astype(np.float32)
        log_initial = transitions.log_initial[self.states].astype(np.float32)
        arcs = self.network.arc_from, arc_log, self.network.arc_start
        path, score = best_path(log_emission, len(logs[0]), NetworkArrays(everywhere, *arcs, log_initial, log_final))
        return self.states[path], score


def build_network_lattice(
    transitions: Transitions, ties: Sequence[Index], allowed_units: NDArray[np.bool_] | None
) -> NetworkLattice:
    """Return the lattice of joint states whose units are allowed in some frame [shape=(T, U)]; None: all."""
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
    network = ForwardBackwardNetwork.of(arc_from, np.searchsorted(arc_to, np.arange(len(states))))
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


@dataclass(frozen=True, eq=False)
class Chains:
    """Chains of hidden states with transitions and emission densities; the first stream and group are of speech."""

    streams: tuple[str, ...]
    transitions: Transitions | FactorialTransitions
    groups: tuple[StreamGroup, ...]

    @property
    def structure(self) -> Structure:
        """The structure of the chains."""
        return self.transitions.product.structure

    @property
    def parameters(self) -> int:
        """How many numbers were learned: of all densities, and the probabilities of moving on; no bigrams of units."""
        learned = sum(len(table) for table in self.transitions.advance)
        for group in self.groups:
            densities, _, size = group.mixtures.size
            components = int(np.isfinite(group.mixtures.log_weights).sum())
            learned += components * (2 * size + 1) - densities
        return learned

    @cached_property
    def full_lattice(self) -> Lattice:
        """The lattice of all joint states, for an utterance without transcript."""
        return self.lattice(None)

    def lattice(self, allowed_units: NDArray[np.bool_] | None) -> Lattice:
        """Return the lattice of the joint states that an utterance may be in, given allowed units [shape=(T, U)]."""
        ties = [group.tie for group in self.groups]
        if isinstance(self.transitions, FactorialTransitions):
            return build_factorial_lattice(self.transitions, ties, allowed_units)
        return build_network_lattice(self.transitions, ties, allowed_units)

    def log_densities(
        self, observations: AudioVisualObservations, lattice: Lattice
    ) -> tuple[tuple[Single, ...], tuple[Single | None, ...]]:
        """Return log densities of all frames, group by group, for the G' densities that the lattice needs.

        Returns log densities [each shape=(T, G')], -inf for units that are not allowed, and the responsibilities of
        mixture components [each shape=(T, M, G')]; None: one component.
        """
        pairs = zip(self.groups, lattice.densities, strict=True)
        of_groups = (group.log_densities(observations, densities) for group, densities in pairs)
        logs, responsibilities = zip(*of_groups, strict=True)
        return lattice.masked(logs), responsibilities

    def infer(self, observations: AudioVisualObservations, lattice: Lattice) -> Inference:
        """Return the posteriors of hidden states together with what they were computed from."""
        logs, responsibilities = self.log_densities(observations, lattice)
        return Inference(observations, lattice, responsibilities, lattice.posteriors(self.transitions, logs))

    def best_path(self, observations: AudioVisualObservations, lattice: Lattice) -> tuple[Index, float]:
        """Return the most probable path of joint states [shape=(T,)] and its log probability; -inf: there is none."""
        return lattice.best_path(self.transitions, self.log_densities(observations, lattice)[0])


@dataclass(frozen=True, eq=False)
class Inference:
    """The posteriors of an utterance, with the observations and the lattice that they come from.

    responsibilities : of the mixture components of each stream group [each shape=(T, M, G')]; None: one component
    """

    observations: AudioVisualObservations
    lattice: Lattice
    responsibilities: tuple[Single | None, ...]
    posteriors: LatticePosteriors

    @property
    def mean_log_likelihood(self) -> float:
        """Log likelihood of the observed streams per frame."""
        return self.posteriors.log_likelihood / self.observations.frames


Array = NDArray[np.float64]
MIN_DEVIATION = 1e-6
GEOMETRY, EIGENLIPS = "geometry", "eigenlips"


@dataclass(frozen=True, eq=False)
class VisualStream:
    """Some dimensions of the motion space as one standardised stream.

    name    : ``geometry`` (lengths and points, or curves) or ``eigenlips``
    columns : the dimensions, among the Q of the space [shape=(q,)]
    dynamic : whether the stream holds slope and curvature (Δ, Δ²) as well as each value
    mean, deviation : of the stream [shape=(D,)], D = q, or 3·q with dynamics (all values, all slopes, all curvatures)
    """

    name: str
    columns: NDArray[np.intp]
    dynamic: bool
    mean: Array
    deviation: Array

    def standardised(self, values: Array) -> NDArray[np.float32]:
        """Return motion in the space [shape=(T, Q)] as this standardised stream [shape=(T, D)]."""
        rows = stream_rows(values[:, self.columns], self.dynamic)
        return ((rows - self.mean) / self.deviation).astype(np.float32)

    def unstandardised(self, means: Array, precisions: Array) -> tuple[Array, Array]:
        """Return means and precisions of the stream [each shape=(T, D)] in units of the space [each shape=(T, 3, q)].

        Axis 1: value, slope, curvature. Without dynamics, slope and curvature have precision 0.
        """
        windows = 3 if self.dynamic else 1
        mean = (means * self.deviation + self.mean).reshape(len(means), windows, -1)
        precision = (precisions / self.deviation**2).reshape(len(means), windows, -1)
        if self.dynamic:
            return mean, precision
        missing = np.zeros((len(means), 2, mean.shape[2]))
        return np.concatenate([mean, missing], axis=1), np.concatenate([precision, missing], axis=1)


def stream_rows(values: Array, dynamic: bool) -> Array:
    """Return values [shape=(T, q)], with their dynamics if ``dynamic``, as rows of a stream [shape=(T, D)]."""
    return with_dynamics(values).reshape(len(values), -1) if dynamic else values


def fit_visual_streams(
    space: MotionSpace, values: Sequence[Array], valid: Sequence[NDArray[np.bool_]], dynamic: bool
) -> tuple[VisualStream, ...]:
    """Return the visual streams of some motion [each shape=(T, Q)], one a kind of channel, scaled on valid frames."""
    units = [space.channels[channel].unit for channel in space.direct]
    other = [unit if unit == GREY else EYE_DISTANCE for unit in units]
    kinds = np.array([*other, *[EYE_DISTANCE] * (space.dimensions - len(units))])
    streams = []
    for kind in dict.fromkeys(kinds.tolist()):
        columns = np.flatnonzero(kinds == kind)
        pairs = zip(values, valid, strict=True)
        rows = np.concatenate([stream_rows(x[:, columns], dynamic)[mask] for x, mask in pairs])
        deviation = np.maximum(rows.std(axis=0), MIN_DEVIATION)
        name = EIGENLIPS if kind == GREY else GEOMETRY
        streams.append(VisualStream(name, columns, dynamic, rows.mean(axis=0), deviation))
    return tuple(streams)


def speech_observations(
    speech: Speech, visual: Sequence[VisualStream], frames: slice = slice(None)
) -> AudioVisualObservations:
    """Return observations of some frames of speech in which no visual stream was observed."""
    features = np.asarray(speech.features.values)[frames]
    empty = tuple(np.zeros((len(features), len(stream.mean)), np.float32) for stream in visual)
    return AudioVisualObservations((features, *empty), (None, *(np.zeros(len(features), bool) for _ in empty)))
