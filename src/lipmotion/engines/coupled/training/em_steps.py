"""The E-step and the M-step of coupled chains (Xie & Liu 2007, Appendix A)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import (
    AudioVisualObservations,
    EmissionStatistics,
    Single,
    reestimated_group,
    zero_emission_statistics,
)
from lipmotion.engines.coupled.chains.lattice import Lattice
from lipmotion.engines.coupled.chains.model import Chains
from lipmotion.engines.coupled.training.alignment import AlignedUtterance, allowed_units
from lipmotion.errors import InputError
from lipmotion.stats.em import Sums, sum_statistics
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint

SHARD = 16
"""Utterances of a shard of the E-step."""
LEAST_FRAMES = 3.0
"""A density with less data than so many frames stays as it is."""
FLOOR_SHARE, LEAST_VARIANCE = 0.01, 1e-4
"""No variance falls under this share of the stream's own variance, or under this least variance."""


@dataclass(frozen=True, eq=False)
class LatticeUtterance:
    """The observations of an utterance, the joint states that it may be in, and how often it counts."""

    observations: AudioVisualObservations
    lattice: Lattice
    weight: float = 1.0


def lattice_utterance(chains: Chains, utterance: AlignedUtterance, weight: float = 1.0) -> LatticeUtterance:
    """Return an utterance, which counts ``weight`` times, with the joint states that its phone labels allow."""
    allowed = allowed_units(chains.structure, utterance.phones, utterance.observations.frames)
    return LatticeUtterance(utterance.observations, chains.lattice(allowed), weight)


@dataclass(frozen=True, eq=False)
class ChainStatistics:
    """Sufficient statistics of chains, accumulated over utterances by their weights.

    transition_counts : of the transitions [shape=(C,)]
    log_likelihood, frames : of the utterances that have a path through the chains
    """

    emissions: tuple[EmissionStatistics, ...]
    transition_counts: NDArray[np.float64]
    log_likelihood: float
    frames: float

    @property
    def mean_log_likelihood(self) -> float:
        """Log likelihood per frame."""
        return self.log_likelihood / self.frames


def e_step(chains: Chains, utterances: Sequence[LatticeUtterance], work: Checkpoint = NO_CHECKPOINT) -> ChainStatistics:
    """Return the sufficient statistics of utterances, whoever computes them. Raises InputError: none has a path."""
    shards = [utterances[start : start + SHARD] for start in range(0, len(utterances), SHARD)]
    sums = sum_statistics(_shard_sums, chains, shards, work)
    if not sums or not sums["frames"]:
        raise InputError(f"none of {len(utterances)} recordings has a path through the chains; check their labels")
    emissions = tuple(
        EmissionStatistics(
            tuple(sums[f"products {number} {stream}"] for stream in group.streams), sums[f"occupancy {number}"]
        )
        for number, group in enumerate(chains.groups)
    )
    return ChainStatistics(emissions, sums["transitions"], float(sums["log likelihood"]), float(sums["frames"]))


def m_step(
    chains: Chains,
    statistics: ChainStatistics,
    floors: Sequence[Single],
    *,
    streams: Sequence[int],
    transitions: bool = True,
) -> Chains:
    """Return the chains that maximise the expected log likelihood, with variances of ``floors`` at least."""
    groups = [
        reestimated_group(group, own, [floors[s] for s in group.streams], LEAST_FRAMES, streams)
        if set(group.streams) & set(streams)
        else group
        for group, own in zip(chains.groups, statistics.emissions, strict=True)
    ]
    new_transitions = (
        chains.transitions.reestimated(statistics.transition_counts) if transitions else chains.transitions
    )
    return replace(chains, groups=tuple(groups), transitions=new_transitions)


def variance_floors(observations: Sequence[AudioVisualObservations]) -> tuple[Single, ...]:
    """Return the least variance of every stream [each shape=(D_s,)], from its variance where it was observed."""
    floors = []
    for stream in range(len(observations[0].streams)):
        masks = [utterance.observed[stream] for utterance in observations]
        rows = [
            utterance.streams[stream] if mask is None else utterance.streams[stream][mask]
            for utterance, mask in zip(observations, masks, strict=True)
        ]
        floors.append(np.maximum(FLOOR_SHARE * np.concatenate(rows).var(axis=0), LEAST_VARIANCE).astype(np.float32))
    return tuple(floors)


def _shard_sums(job: tuple[Chains, Sequence[LatticeUtterance]]) -> Sums:
    chains, utterances = job
    emission_statistics = tuple(zero_emission_statistics(group) for group in chains.groups)
    transition_counts = np.zeros(chains.transitions.statistic_count)
    log_likelihood, frames = 0.0, 0.0
    for utterance in utterances:
        observations, lattice, weight = utterance.observations, utterance.lattice, utterance.weight
        emissions = chains.emission_log_densities(observations, lattice)
        posteriors = chains.posteriors(emissions, lattice)
        if not np.isfinite(posteriors.log_likelihood):
            continue
        for statistics, group, densities, posterior, responsibilities in zip(
            emission_statistics,
            chains.groups,
            lattice.densities,
            posteriors.densities,
            emissions.responsibilities,
            strict=True,
        ):
            weighted = posterior if weight == 1 else posterior * np.float32(weight)
            statistics.accumulate(group, observations, densities, weighted, responsibilities)
        transition_counts[lattice.transition_index] += weight * posteriors.transition_counts
        log_likelihood += weight * posteriors.log_likelihood
        frames += weight * observations.frames
    sums = {"transitions": transition_counts, "log likelihood": np.array(log_likelihood), "frames": np.array(frames)}
    for number, (group, statistics) in enumerate(zip(chains.groups, emission_statistics, strict=True)):
        products = zip(group.streams, statistics.products, strict=True)
        sums |= {f"products {number} {stream}": array for stream, array in products}
        sums[f"occupancy {number}"] = statistics.occupancy
    return sums
