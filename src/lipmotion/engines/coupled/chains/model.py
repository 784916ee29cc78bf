"""Coupled chains: their product with its transitions, their emission densities, and inference."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import (
    AudioVisualObservations,
    EmissionEvaluator,
    Single,
    StreamGroup,
)
from lipmotion.engines.coupled.chains.factorial_lattice import FactorialTransitions, factorial_lattice
from lipmotion.engines.coupled.chains.lattice import Index, Lattice, LatticePosteriors
from lipmotion.engines.coupled.chains.network_lattice import network_lattice
from lipmotion.engines.coupled.chains.structures import Structure
from lipmotion.engines.coupled.chains.transitions import Transitions


@dataclass(frozen=True, eq=False)
class Chains:
    """Chains of hidden states with their transitions and emission densities.

    streams     : the names of the streams; the first is speech
    transitions : with the product of the chains
    groups      : the stream groups; speech is in the first
    """

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
        return self._lattice(None)

    def lattice(self, allowed_units: NDArray[np.bool_]) -> Lattice:
        """Return the lattice of the joint states that an utterance may be in.

        allowed_units : the units of the first chain that each frame may belong to [shape=(T, U)]
        """
        return self._lattice(allowed_units)

    def _lattice(self, allowed_units: NDArray[np.bool_] | None) -> Lattice:
        ties = [group.tie for group in self.groups]
        if isinstance(self.transitions, FactorialTransitions):
            return factorial_lattice(self.transitions, ties, allowed_units)
        return network_lattice(self.transitions, ties, allowed_units)

    @cached_property
    def evaluators(self) -> tuple[EmissionEvaluator, ...]:
        """The emission densities of each stream group, in the form in which they are computed."""
        return tuple(group.evaluator() for group in self.groups)

    def emission_log_densities(self, observations: AudioVisualObservations, lattice: Lattice) -> EmissionLogDensities:
        """Return the log densities of all frames under the densities that the lattice needs."""
        computed = [
            evaluator.log_densities(observations, densities)
            for evaluator, densities in zip(self.evaluators, lattice.densities, strict=True)
        ]
        return EmissionLogDensities(
            lattice.masked([log for log, _ in computed]), tuple(responsibilities for _, responsibilities in computed)
        )

    def posteriors(self, emissions: EmissionLogDensities, lattice: Lattice) -> LatticePosteriors:
        """Return the posteriors of hidden states, and expected transition counts."""
        return lattice.posteriors(self.transitions, emissions.log_densities)

    def infer(self, observations: AudioVisualObservations, lattice: Lattice) -> Inference:
        """Return the posteriors of hidden states together with what they were computed from."""
        emissions = self.emission_log_densities(observations, lattice)
        return Inference(observations, lattice, emissions, self.posteriors(emissions, lattice))

    def best_path(self, emissions: EmissionLogDensities, lattice: Lattice) -> tuple[Index, float]:
        """Return the most probable path of joint states [shape=(T,)] and its log probability; -inf: there is none."""
        return lattice.best_path(self.transitions, emissions.log_densities)


@dataclass(frozen=True, eq=False)
class EmissionLogDensities:
    """Log densities of the frames of an utterance, group by group, for the G' densities that a lattice needs.

    log_densities    : of each stream group [each shape=(T, G')]
    responsibilities : of the mixture components of each [each shape=(T, M, G')]; None: one component
    """

    log_densities: tuple[Single, ...]
    responsibilities: tuple[Single | None, ...]


@dataclass(frozen=True, eq=False)
class Inference:
    """The posteriors of an utterance, with the observations, lattice and emission densities that they come from."""

    observations: AudioVisualObservations
    lattice: Lattice
    emissions: EmissionLogDensities
    posteriors: LatticePosteriors

    @property
    def mean_log_likelihood(self) -> float:
        """Log likelihood of the observed streams per frame."""
        return self.posteriors.log_likelihood / self.observations.frames
