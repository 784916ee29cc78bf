"""EM training of coupled chains from speech with motion, with more and more Gaussians."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import Single
from lipmotion.engines.coupled.chains.model import Chains
from lipmotion.engines.coupled.chains.structures import Structure
from lipmotion.engines.coupled.training.alignment import AlignedUtterance
from lipmotion.engines.coupled.training.em_steps import (
    ChainStatistics,
    LatticeUtterance,
    e_step,
    lattice_utterance,
    m_step,
    variance_floors,
)
from lipmotion.engines.coupled.training.initialisation import initial_chains
from lipmotion.stats.em import EmResult, run_em
from lipmotion.stats.mixture import Mixtures

FRAMES_A_GAUSSIAN = 25.0
"""A density is split if it has so many frames for each Gaussian that it would have."""
CONVERGENCE_GAIN = 0.02
"""EM ends when the log likelihood per frame gains less."""


@dataclass(frozen=True)
class TrainingStep:
    """One step of EM.

    log_likelihood : mean log likelihood per frame before the step
    """

    mixtures: tuple[int, ...]
    log_likelihood: float


Report = Callable[[TrainingStep], None]


def no_report(step: TrainingStep) -> None:
    """Report nothing after a step."""


@dataclass(frozen=True)
class MixtureSchedule:
    """How many Gaussians densities get, and how many steps of EM.

    mixtures   : Gaussians per density of each stream group in the end, powers of two
    most_steps : greatest number of EM steps between one splitting and the next
    """

    mixtures: tuple[int, ...]
    weights: tuple[float, ...]
    most_steps: int = 6


def growing_chains(
    structure: Structure,
    streams: tuple[str, ...],
    data: Sequence[AlignedUtterance],
    schedule: MixtureSchedule,
    report: Report = no_report,
    workers: int = 1,
) -> Iterator[EmResult[Chains, ChainStatistics]]:
    """Yield results of EM, started by Viterbi training: chains with 1, 2, 4, … Gaussians, each to convergence.

    streams : the names of the streams
    report  : is called after every step; while the number of components stays, the log likelihood never falls
    Source: Xie & Liu 2007, §3.4 and Appendix A, with scaled recursions.
    """
    floors = variance_floors([utterance.observations for utterance in data])
    chains = initial_chains(structure, streams, data, schedule.weights, floors)
    utterances = [lattice_utterance(chains, utterance) for utterance in data]
    while True:
        result = train_to_convergence(chains, utterances, floors, schedule.most_steps, report, workers)
        yield result
        counts = component_counts(result.model)
        if all(count >= most for count, most in zip(counts, schedule.mixtures, strict=True)):
            return
        chains = with_split_components(result.model, schedule.mixtures, result.statistics)


def train_to_convergence(
    chains: Chains,
    utterances: Sequence[LatticeUtterance],
    floors: Sequence[Single],
    most_steps: int,
    report: Report,
    workers: int,
    *,
    speech_only: bool = False,
) -> EmResult[Chains, ChainStatistics]:
    """Return the result of EM with a fixed number of components.

    floors      : the least variance of each stream [each shape=(D_s,)]
    speech_only : re-estimate the densities of speech, and keep all else
    """
    streams = range(1 if speech_only else len(chains.streams))
    return run_em(
        chains,
        lambda chains: e_step(chains, utterances, workers),
        lambda chains, statistics: m_step(chains, statistics, floors, streams=streams, transitions=not speech_only),
        most_steps,
        lambda _, chains, statistics: report(TrainingStep(component_counts(chains), statistics.mean_log_likelihood)),
        least_gain=CONVERGENCE_GAIN,
    )


def component_counts(chains: Chains) -> tuple[int, ...]:
    """Return the number of Gaussians per density of each stream group."""
    return tuple(group.mixtures.size[1] for group in chains.groups)


def with_split_components(chains: Chains, most: Sequence[int], statistics: ChainStatistics) -> Chains:
    """Return chains with twice as many Gaussians in the densities of those groups that have fewer than ``most``.

    statistics : of the last E-step; a density with too little data keeps its components, the new ones are switched off
    """
    groups = [
        replace(group, mixtures=_split(group.mixtures, own.occupancy)) if count < target else group
        for group, own, count, target in zip(
            chains.groups, statistics.emissions, component_counts(chains), most, strict=True
        )
    ]
    return replace(chains, groups=tuple(groups))


def _split(mixtures: Mixtures, occupancy: NDArray[np.float64]) -> Mixtures:
    """Return the mixtures with twice as many components; ``occupancy`` is that of the present ones [shape=(M, G)]."""
    halves, now = mixtures.split(), mixtures.log_weights.shape[1]
    few = occupancy.sum(axis=0) < FRAMES_A_GAUSSIAN * 2 * np.isfinite(mixtures.log_weights).sum(axis=1)
    halves.log_weights[few, :now] = mixtures.log_weights[few]
    halves.means[few, :now] = mixtures.means[few]
    halves.log_weights[few, now:] = -np.inf
    return halves
